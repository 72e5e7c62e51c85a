//! The ends of tracks: keyframes that may not be where their submap has them.
//!
//! A camera that a lift carries away is found out some seconds later (method 12.8). The last keyframes of a submap
//! may show the cabin and its doors, and where a run ends before the ride was noticed, another storey.

use crate::map::state::KeyframeState;
use std::collections::BTreeMap;

/// Time without a new keyframe after which the camera stood, nanoseconds.
const STOOD_NANOS: i64 = 2_000_000_000;
/// Time in which a cabin is entered and its door closes, nanoseconds.
const ENTERED_NANOS: i64 = 2_500_000_000;
/// Time from a stand to the end of a submap within which a ride may be unnoticed, nanoseconds.
const UNNOTICED_NANOS: i64 = 12_000_000_000;

/// By keyframe: whether it is one of the last of its submap, or the camera stood shortly before that ended and it
/// is of then or later.
pub(crate) fn at_track_ends(keyframes: &[KeyframeState]) -> Vec<bool> {
    let mut tracks: BTreeMap<(u32, u32), Vec<i64>> = BTreeMap::new();
    for k in keyframes {
        tracks.entry((k.session, k.submap)).or_default().push(k.stamp_nanos);
    }
    let ends: BTreeMap<(u32, u32), i64> =
        tracks.into_iter().map(|(track, stamps)| (track, end_of(stamps))).collect();
    keyframes
        .iter()
        .map(|k| ends.get(&(k.session, k.submap)).is_some_and(|end| k.stamp_nanos >= *end))
        .collect()
}

/// Where the end of a track begins: it is the last tenth at most, for of a short track all says something.
fn end_of(mut stamps: Vec<i64>) -> i64 {
    stamps.sort_unstable();
    let (first, last) = (stamps.first().copied().unwrap_or(0), stamps.last().copied().unwrap_or(0));
    let is_late_stand = |pair: &&[i64]| {
        pair[1].saturating_sub(pair[0]) >= STOOD_NANOS && last.saturating_sub(pair[1]) <= UNNOTICED_NANOS
    };
    let stood = stamps.windows(2).find(is_late_stand).map_or(last, |pair| pair[0]);
    stood.saturating_sub(ENTERED_NANOS).max(last.saturating_sub(last.saturating_sub(first) / 10))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::test_wall::keyframe;

    /// Keyframes of submaps at these times, tenths of a second.
    fn made(at: &[(u32, i64)]) -> Vec<KeyframeState> {
        let made = |(id, &(submap, tenths)): (u32, &(u32, i64))| KeyframeState {
            submap,
            stamp_nanos: tenths * 100_000_000,
            ..keyframe(id, 0, 0.0)
        };
        (0..).zip(at).map(made).collect()
    }

    #[test]
    fn the_last_of_a_track_and_what_follows_a_late_stand_are_at_its_end() {
        // A hundred seconds on foot, a keyframe each second, and some more.
        let n_before_end = |more: &[i64]| {
            let at: Vec<(u32, i64)> =
                (0..100).map(|k| 10 * k).chain(more.iter().copied()).map(|t| (0, t)).collect();
            at_track_ends(&made(&at)).iter().filter(|is_end| !**is_end).count()
        };
        assert_eq!(n_before_end(&[]), 97, "the last 2.5 s");
        assert_eq!(n_before_end(&[1040, 1050]), 97, "it stood, and went on for a second");
        let on: Vec<i64> = (0..10).map(|k| 1040 + 15 * k).collect();
        assert_eq!(n_before_end(&on), 108, "it stood long ago");
        assert!(at_track_ends(&[]).is_empty());
    }

    #[test]
    fn the_end_of_a_track_is_a_tenth_of_it_at_most() {
        let at: Vec<(u32, i64)> = (0..20).flat_map(|k| [(0, 10 * k), (1, 10 * k + 5)]).collect();
        let ends = at_track_ends(&made(&at));
        assert_eq!(ends.iter().filter(|is_end| **is_end).count(), 4, "two of each submap");
        assert!(ends[36..].iter().all(|is_end| *is_end));
    }
}
