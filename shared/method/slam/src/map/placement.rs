//! Effect of records on where keyframes stand: the one fold that gives final poses (method 8.5).
//!
//! A correction names the keyframes that were solved for, which are those of the working map at its request.
//! They take their corrected poses; a culled one moves rigidly with the keyframe that it is anchored to, and
//! what was estimated after the request with the last one before it in its submap. A join moves all poses of
//! one component into the gauge of another. The tracker's state and
//! [`PoseHistory`](crate::PoseHistory) use these functions.

use crate::map::correction::Correction;
use crate::map::keyframe::{KeyframePose, KeyframeState, RetiredRecord};
use crate::map::records::{JoinRecord, SplitRecord};
use crate::map::split;
use crate::map::submaps::Submaps;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use tessera_geometry::{Pose, PoseBits, Twist, compose_normalised};

/// Pose, submap and anchor of a keyframe.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Placement {
    /// The submap that it was made in.
    pub(crate) submap: u32,
    /// Its pose after all corrections so far.
    pub(crate) world_from_camera: PoseBits,
    /// The keyframe that it moves along with since it left the working map; itself, where it is of what the
    /// camera was carried in.
    pub(crate) anchored_to: Option<u32>,
}

/// Anything with a placement. Keyframes are in slices, indexed by id.
pub(crate) trait HasPlacement {
    fn placement(&self) -> Placement;

    fn set_placement(&mut self, placement: Placement);
}

impl HasPlacement for Placement {
    fn placement(&self) -> Placement {
        *self
    }

    fn set_placement(&mut self, placement: Placement) {
        *self = placement;
    }
}

impl HasPlacement for KeyframeState {
    fn placement(&self) -> Placement {
        let Self { submap, world_from_camera, anchored_to, .. } = *self;
        Placement { submap, world_from_camera, anchored_to }
    }

    fn set_placement(&mut self, placement: Placement) {
        let Placement { submap, world_from_camera, anchored_to } = placement;
        (self.submap, self.world_from_camera, self.anchored_to) = (submap, world_from_camera, anchored_to);
    }
}

/// Rigid motion in the world, `new_world_from_old_world`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RigidMotion(pub(crate) Pose);

impl RigidMotion {
    /// The motion that takes one pose to another.
    pub(crate) fn between(old: &PoseBits, new: &PoseBits) -> Self {
        Self(Pose::from(new) * Pose::from(old).inverse())
    }

    /// The moved pose, its quaternion normalised.
    pub(crate) fn of(&self, world_from_camera: &PoseBits) -> PoseBits {
        let moved = self.0 * Pose::from(world_from_camera);
        PoseBits::from(&compose_normalised(&moved, &Twist::default()))
    }
}

/// Sets the poses of single keyframes.
pub(crate) fn apply_poses<K: HasPlacement>(keyframes: &mut [K], poses: &[KeyframePose]) {
    for KeyframePose { id, world_from_camera } in poses {
        if let Some(keyframe) = keyframes.get_mut(*id as usize) {
            set_pose(keyframe, *world_from_camera);
        }
    }
}

fn set_pose<K: HasPlacement>(keyframe: &mut K, world_from_camera: PoseBits) {
    keyframe.set_placement(Placement { world_from_camera, ..keyframe.placement() });
}

/// Motions of what was estimated after a request, by submap; what lies in others does not move.
pub(crate) type Motions = BTreeMap<u32, RigidMotion>;

/// Applies a correction to the keyframes and returns the motions of everything estimated after the
/// request; `None` where the correction is empty, as that of a declined request.
pub(crate) fn apply_correction<K: HasPlacement>(
    keyframes: &mut [K],
    correction: &Correction,
) -> Option<Motions> {
    let (poses, motions) = corrected(keyframes, &correction.keyframes)?;
    for (keyframe, pose) in keyframes.iter_mut().zip(poses) {
        set_pose(keyframe, pose);
    }
    Some(motions)
}

/// Poses of all keyframes where those that are `named` have new ones, and the motions of what came after the
/// last of them; `None` where none is named.
pub(crate) fn corrected<K: HasPlacement>(
    keyframes: &[K],
    named: &[KeyframePose],
) -> Option<(Vec<PoseBits>, Motions)> {
    // Few are named of all that a run of days has made.
    let solved: BTreeMap<u32, &PoseBits> = named.iter().map(|k| (k.id, &k.world_from_camera)).collect();
    let last = *solved.last_key_value()?.0;
    let until_last = keyframes.get(..=last as usize)?;
    let motion_of = |id: u32| -> Option<RigidMotion> {
        Some(RigidMotion::between(
            &keyframes.get(id as usize)?.placement().world_from_camera,
            solved.get(&id)?,
        ))
    };
    let moved = |id: u32, Placement { world_from_camera, anchored_to, .. }: Placement| match solved.get(&id) {
        Some(solved) => Some(**solved),
        None => anchored_to.and_then(motion_of).map(|motion| motion.of(&world_from_camera)),
    };
    let mut motions = Motions::new();
    for (id, keyframe) in (0..=last).rev().zip(until_last.iter().rev()) {
        let placement = keyframe.placement();
        if let Entry::Vacant(motion) = motions.entry(placement.submap)
            && let Some(new) = moved(id, placement)
        {
            motion.insert(RigidMotion::between(&placement.world_from_camera, &new));
        }
    }
    let rest = |Placement { submap, world_from_camera, anchored_to }: Placement| {
        let anchor = anchored_to.and_then(|anchor| keyframes.get(anchor as usize));
        let motion = motions.get(&anchor.map_or(submap, |anchor| anchor.placement().submap));
        motion.map_or(world_from_camera, |motion| motion.of(&world_from_camera))
    };
    let placements = (0..).zip(keyframes.iter().map(HasPlacement::placement));
    let poses = placements.map(|(id, placement)| moved(id, placement).unwrap_or_else(|| rest(placement)));
    let poses = poses.collect();
    Some((poses, motions))
}

/// Anchors a culled keyframe, and what was anchored to it.
pub(crate) fn apply_retired<K: HasPlacement>(keyframes: &mut [K], retired: &RetiredRecord) {
    for (id, keyframe) in (0..).zip(keyframes) {
        let placement = keyframe.placement();
        if id == retired.keyframe || placement.anchored_to == Some(retired.keyframe) {
            keyframe.set_placement(Placement { anchored_to: Some(retired.anchored_to), ..placement });
        }
    }
}

/// Puts the keyframes of a split into their submaps, of which the last one is `submap`: their poses stay as
/// they are, and what was anchored across is anchored again. What the camera was carried in is no place to
/// come back to: its keyframes leave the working map, each its own anchor.
pub(crate) fn apply_split<K: HasPlacement>(keyframes: &mut [K], split: &SplitRecord, submap: u32) {
    let firsts: Vec<u32> = split.firsts().collect();
    for (first, back) in firsts.iter().zip((0..firsts.len() as u32).rev()) {
        for keyframe in keyframes.iter_mut().skip(*first as usize) {
            let submap = submap.saturating_sub(back);
            keyframe.set_placement(Placement { submap, ..keyframe.placement() });
        }
    }
    split::anchor_within_parts(keyframes, split);
    // Bounded by the keyframes, whatever a record names.
    let n_before = split.carried.unwrap_or(u32::MAX) as usize;
    for (id, keyframe) in (0..).zip(keyframes).take(split.first as usize).skip(n_before) {
        keyframe.set_placement(Placement { anchored_to: Some(id), ..keyframe.placement() });
    }
}

/// Moves one component's keyframes into the gauge of another, makes one of both, and returns the
/// motion.
pub(crate) fn apply_join<K: HasPlacement>(
    keyframes: &mut [K],
    submaps: &mut Submaps,
    join: &JoinRecord,
) -> RigidMotion {
    let motion = RigidMotion(Pose::from(&join.kept_from_moved));
    for keyframe in keyframes {
        let Placement { submap, world_from_camera, .. } = keyframe.placement();
        if submaps.component(submap) == join.moved {
            set_pose(keyframe, motion.of(&world_from_camera));
        }
    }
    submaps.join(join.kept, join.moved);
    motion
}

#[cfg(test)]
mod tests {
    use super::*;

    fn along_x(x_m: f64) -> PoseBits {
        PoseBits::from(&Pose::translation(x_m, 0.0, 0.0))
    }

    fn placed(submap: u32, x_m: f64, anchored_to: Option<u32>) -> Placement {
        Placement { submap, world_from_camera: along_x(x_m), anchored_to }
    }

    fn solved(id: u32, x_m: f64) -> KeyframePose {
        KeyframePose { id, world_from_camera: along_x(x_m) }
    }

    /// Placements of keyframes once others have the poses that were solved for.
    fn after(keyframes: &[Placement], named: &[KeyframePose]) -> Vec<f64> {
        let poses = corrected(keyframes, named).map_or(Vec::new(), |(poses, _)| poses);
        poses.iter().map(|pose| pose.translation_m[0]).collect()
    }

    #[test]
    fn a_submap_moves_with_its_own_keyframes_and_at_a_join() {
        let mut keyframes = [(0, 0.0), (1, 1.0), (0, 2.0), (1, 3.0)].map(|(s, x)| placed(s, x, None));
        let named = [solved(0, 0.5), solved(1, 5.0)];
        assert_eq!(after(&keyframes, &named), [0.5, 5.0, 2.5, 7.0]);
        let mut submaps = Submaps::apart(2);
        let join = JoinRecord { kept: 0, moved: 1, kept_from_moved: along_x(10.0) };
        apply_join(&mut keyframes, &mut submaps, &join);
        assert_eq!(keyframes.map(|k| k.world_from_camera.translation_m[0]), [0.0, 11.0, 2.0, 13.0]);
        assert_eq!(submaps.n_components(), 1);
    }

    #[test]
    fn a_culled_keyframe_moves_along_with_its_anchor_whenever_it_was_culled() {
        let mut keyframes = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0].map(|x| placed(0, x, None));
        keyframes[1].anchored_to = Some(0);
        // Keyframes 0, 2 and 3 were asked for; 4 and 5 came later.
        let named = [solved(0, 0.0), solved(2, 2.5), solved(3, 4.0)];
        assert_eq!(after(&keyframes, &named), [0.0, 1.0, 2.5, 4.0, 5.0, 6.0]);
        keyframes[1].anchored_to = Some(2);
        assert_eq!(after(&keyframes, &named), [0.0, 1.5, 2.5, 4.0, 5.0, 6.0]);
        // What is anchored to a later one moves as that does.
        keyframes[1].anchored_to = Some(5);
        assert_eq!(after(&keyframes, &named), [0.0, 2.0, 2.5, 4.0, 5.0, 6.0]);
        // Culled since it was asked for: it was solved for.
        keyframes[2].anchored_to = Some(0);
        assert_eq!(after(&keyframes, &named), [0.0, 2.0, 2.5, 4.0, 5.0, 6.0]);
        assert_eq!(after(&keyframes, &[solved(6, 0.0)]), [], "a keyframe that is not there");
    }

    #[test]
    fn a_submap_of_culled_keyframes_alone_moves_with_the_anchor_of_the_last() {
        let keyframes =
            [placed(0, 0.0, None), placed(1, 1.0, Some(0)), placed(0, 2.0, None), placed(1, 3.0, None)];
        assert_eq!(after(&keyframes, &[solved(0, 0.5), solved(2, 9.0)]), [0.5, 1.5, 9.0, 3.5]);
    }

    #[test]
    fn what_was_anchored_to_a_keyframe_goes_where_it_goes() {
        let mut keyframes = [0.0, 0.1, 0.2, 0.3].map(|x| placed(0, x, None));
        apply_retired(&mut keyframes, &RetiredRecord { keyframe: 1, anchored_to: 2 });
        apply_retired(&mut keyframes, &RetiredRecord { keyframe: 2, anchored_to: 3 });
        assert_eq!(keyframes.map(|k| k.anchored_to), [None, Some(3), Some(3), None]);
        let found = after(&keyframes, &[solved(0, 0.0), solved(3, 1.3)]);
        assert!(found.iter().zip([0.0, 1.1, 1.2, 1.3]).all(|(x, expected)| (x - expected).abs() < 1e-12));
    }

    #[test]
    fn a_split_gives_the_latest_keyframes_to_new_submaps() {
        let mut keyframes = [0, 0, 0, 0, 0].map(|submap| placed(submap, 1.0, None));
        keyframes[3].anchored_to = Some(4);
        apply_split(&mut keyframes, &SplitRecord::since(4), 1);
        assert_eq!(keyframes.map(|k| k.submap), [0, 0, 0, 0, 1]);
        assert_eq!(keyframes[3].anchored_to, Some(0));
        apply_split(&mut keyframes, &SplitRecord { carried: Some(1), first: 3 }, 3);
        assert_eq!(keyframes.map(|k| k.submap), [0, 2, 2, 3, 3]);
        assert_eq!(keyframes.map(|k| k.anchored_to), [None, Some(1), Some(2), Some(4), None]);
        assert_eq!(after(&keyframes, &[solved(0, 2.0), solved(4, 3.0)]), [2.0, 1.0, 1.0, 3.0, 3.0]);
        assert!(keyframes.iter().all(|k| k.world_from_camera == along_x(1.0)));
    }
}
