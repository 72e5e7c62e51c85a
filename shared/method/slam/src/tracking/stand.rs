//! When keyframes were made, and what that says of where the camera stood: in a lift it makes none (method 12.8).

use crate::map::records::SplitRecord;
use crate::map::state::KeyframeState;
use crate::map::submaps::Submaps;

/// Time without a new keyframe after which the camera stood, nanoseconds.
pub(crate) const STOOD_NANOS: i64 = 2_000_000_000;
/// Time from then to the first miss, at most, nanoseconds.
const SOON_NANOS: i64 = 3_000_000_000;
/// Time without a new keyframe after which what moved before the camera, such as a door, has come to rest,
/// nanoseconds.
const SETTLED_NANOS: i64 = 600_000_000;

/// Time behind a ride that was not noticed in which its doors move, nanoseconds.
const DOORS_NANOS: i64 = 5_000_000_000;

/// The first keyframe of the camera's submap, where that was joined to older ones: nothing carried the camera,
/// so it is the join that was wrong. `None` where it was not joined, or has gone on from an older one since.
pub(crate) fn joined_since(made: &[Made], submaps: &Submaps) -> Option<u32> {
    let submap = made.last()?.submap;
    let n_own = made.iter().rev().take_while(|k| k.submap == submap).count();
    let (before, own) = made.split_at(made.len() - n_own);
    let is_joined = before.iter().any(|k| submaps.component(k.submap) == submaps.component(submap));
    let is_chain = before.iter().all(|k| k.submap < submap);
    (is_joined && is_chain).then(|| own[0].id)
}

/// When a keyframe was made.
#[derive(Clone, Copy)]
pub(crate) struct Made {
    pub(crate) id: u32,
    pub(crate) stamp_nanos: i64,
    /// The run that made it.
    pub(crate) session: u32,
    pub(crate) submap: u32,
}

impl Made {
    pub(crate) fn of(keyframe: &KeyframeState) -> Self {
        let KeyframeState { id, stamp_nanos, session, submap, .. } = *keyframe;
        Self { id, stamp_nanos, session, submap }
    }

    /// Whether it was made in the moments before another one of its submap.
    pub(crate) fn is_soon_before(&self, other: &Self) -> bool {
        self.submap == other.submap && other.stamp_nanos.saturating_sub(self.stamp_nanos) <= SOON_NANOS
    }
}

/// The first keyframe from which on one comes within [`SOON_NANOS`] before another one of its submap.
fn soon_before(made: &[Made], at: usize) -> usize {
    at - made[..at].iter().rev().take_while(|k| k.is_soon_before(&made[at])).count()
}

/// Whether no keyframe came between two for so long, in the submap of the first one.
fn is_pause(pair: &[Made], submap: u32, nanos: i64) -> bool {
    pair[0].submap == submap && pair[1].stamp_nanos.saturating_sub(pair[0].stamp_nanos) >= nanos
}

/// The last keyframe before the camera stood, just before the first miss or since then.
pub(crate) fn stand(made: &[Made], first: usize) -> Option<usize> {
    let from = soon_before(made, first).saturating_sub(1);
    let stood = |pair: &[Made]| is_pause(pair, made[first].submap, STOOD_NANOS);
    made[from..].windows(2).rposition(stood).map(|place| from + place)
}

/// The same where the camera went on for long before the first miss: that it was carried was not noticed. `None`
/// where it has not stood since its submap began, or went on in it in this run.
pub(crate) fn stood_long_ago(made: &[Made], first: usize) -> Option<usize> {
    let Made { session, submap, .. } = made[first];
    let is_of_it = |k: &&Made| (k.session, k.submap) == (session, submap);
    let begun = first - made[..first].iter().rev().take_while(is_of_it).count();
    let stood = made[begun..=first].windows(2).rposition(|pair| is_pause(pair, submap, STOOD_NANOS))?;
    Some(begun + stood)
}

/// As [`border`], where that the camera was carried was noticed long after. Or it was the join of the submap that
/// was wrong, with this keyframe as the first since then: so what lay before leaves as well, by itself.
pub(crate) fn border_long_ago(
    made: &[Made],
    (first, stood): (usize, usize),
    joined: Option<u32>,
) -> SplitRecord {
    let until = made[stood + 1].stamp_nanos.saturating_add(DOORS_NANOS);
    let n_soon = made[stood..=first].iter().take_while(|k| k.stamp_nanos <= until).count();
    let soon = &made[..stood + n_soon.max(2)];
    let split = border(soon, soon.len() - 1, stood);
    SplitRecord { before: joined.filter(|id| split.carried.is_some_and(|carried| *id < carried)), ..split }
}

/// Which of the latest keyframes are of new submaps, where the first miss was with this one and the camera had
/// stood in something that moved. Its doors moved before it left and when it had come: their time goes along.
pub(crate) fn border(made: &[Made], first: usize, stood: usize) -> SplitRecord {
    let is_settled = |pair: &&[Made]| is_pause(pair, made[first].submap, SETTLED_NANOS);
    let before = made[soon_before(made, stood)..=stood].windows(2).rfind(is_settled);
    let carried = before.map_or(made[stood].id, |pair| pair[1].id);
    let arrived = made[stood..].windows(2).rfind(is_settled).map_or(made[stood + 1].id, |pair| pair[1].id);
    SplitRecord { before: None, carried: Some(carried.min(made[first].id)), first: arrived }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Keyframes at these times, tenths of a second.
    fn at(tenths: &[i64]) -> Vec<Made> {
        let made = |(id, t): (u32, &i64)| Made { id, stamp_nanos: t * 100_000_000, session: 0, submap: 0 };
        (0..).zip(tenths).map(made).collect()
    }

    fn border_of(made: &[Made], first: usize) -> Option<(u32, u32)> {
        let SplitRecord { carried, first, .. } = border(made, first, stand(made, first)?);
        Some((carried?, first))
    }

    #[test]
    fn where_the_camera_had_stood_what_it_stood_in_is_a_submap() {
        let walk = at(&[0, 5, 10, 15, 20, 25]);
        assert_eq!(border_of(&walk, 3), None);
        // It stood after the first miss, before it, and long before it.
        let ride = at(&[0, 5, 10, 110, 115, 120]);
        assert_eq!((border_of(&ride, 1), border_of(&ride, 4)), (Some((1, 3)), Some((2, 3))));
        let later = at(&[0, 100, 105, 110, 115, 120, 125, 130, 135]);
        assert_eq!(border_of(&later, 8), None);
        let mut lost = ride;
        lost[..3].iter_mut().for_each(|k| k.submap = 7);
        assert_eq!((border_of(&lost, 3), border_of(&at(&[0]), 0)), (None, None));
    }

    #[test]
    fn a_ride_that_was_not_noticed_parts_what_came_before_and_after_it() {
        // A way, a ride, whose door opens for a second, and a long way behind it with a pause.
        let way: Vec<i64> = (0..13).map(|k| 5 * k).collect();
        let behind: Vec<i64> = (0..300).map(|k| 174 + 5 * k + if k > 200 { 10 } else { 0 }).collect();
        let made = at(&[way.as_slice(), &[160, 163, 166], &behind].concat());
        let first = made.len() - 2;
        assert_eq!(stand(&made, first), None);
        let stood = stood_long_ago(&made, first).unwrap();
        assert_eq!(stood, 12);
        let split = |joined| border_long_ago(&made, (first, stood), joined);
        let parts = SplitRecord { before: None, carried: Some(12), first: 16 };
        assert_eq!(split(None), parts, "behind the door");
        assert_eq!(split(Some(4)), SplitRecord { before: Some(4), ..parts }, "its join may have been wrong");
        assert_eq!(split(Some(12)), parts, "nothing lay before");
        let mut elsewhere = made.clone();
        elsewhere[..13].iter_mut().for_each(|k| k.submap = 3);
        assert_eq!(stood_long_ago(&elsewhere, first), None, "it stood in another submap");
        let mut later = made;
        later[13..].iter_mut().for_each(|k| k.session = 1);
        assert_eq!(stood_long_ago(&later, first), None, "between two runs");
    }

    #[test]
    fn the_doors_of_a_lift_move_in_its_own_time() {
        // It comes in, the door closes, the lift goes, the door opens, it leaves.
        let ride = at(&[0, 3, 6, 20, 22, 24, 90, 92, 94, 110, 112, 114]);
        assert_eq!(border_of(&ride, 6), Some((3, 9)));
        assert_eq!(border_of(&ride[..9], 6), Some((3, 6)), "the door still moves");
    }

    #[test]
    fn a_contradiction_on_foot_takes_back_the_join_of_the_submap_alone() {
        let made = |submaps: &[u32]| -> Vec<Made> {
            let made = |(id, submap): (u32, &u32)| Made {
                id,
                stamp_nanos: i64::from(id),
                session: 0,
                submap: *submap,
            };
            (0..).zip(submaps).map(made).collect()
        };
        let mut joined = Submaps::apart(3);
        joined.join(2, 0);
        assert_eq!(joined_since(&made(&[0, 0, 1, 2, 2]), &joined), Some(3));
        assert_eq!(joined_since(&made(&[0, 0, 1, 1]), &joined), None, "it stands alone");
        assert_eq!(joined_since(&made(&[0, 2, 2, 0]), &joined), None, "it went on from the older one");
        assert_eq!(joined_since(&made(&[0, 0]), &joined), None);
    }
}
