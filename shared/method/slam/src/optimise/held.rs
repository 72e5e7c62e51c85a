//! Which submaps an optimisation holds together (method 12.8).

use crate::map::records::{LoopRecord, LoopVerdict};
use crate::map::state::KeyframeState;
use crate::map::submaps::Submaps;
use std::collections::BTreeMap;

/// The components of `n` submaps that hang together by accepted loops, or by keyframes that are
/// anchored to those of another submap, alone.
pub(crate) fn held(n: u32, loops: &[LoopRecord], keyframes: &[KeyframeState]) -> Submaps {
    let mut held = Submaps::apart(n);
    let submaps: BTreeMap<u32, u32> = keyframes.iter().map(|k| (k.id, k.submap)).collect();
    let accepted = loops.iter().filter(|l| l.verdict == LoopVerdict::Accepted && l.weight > 0.0);
    let anchors = keyframes.iter().filter_map(|k| Some((k.id, k.anchored_to?)));
    for (a, b) in accepted.map(|l| (l.newer, l.older)).chain(anchors) {
        if let (Some(a), Some(b)) = (submaps.get(&a), submaps.get(&b)) {
            held.join(*a, *b);
        }
    }
    held
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::keyframe;

    #[test]
    fn accepted_loops_and_anchors_hold_submaps_together() {
        let made_in = |id: u32, submap: u32| KeyframeState { submap, ..keyframe(id, 0, 0.0) };
        let mut keyframes = [made_in(0, 0), made_in(1, 1), made_in(2, 2), made_in(3, 3)];
        keyframes[3].anchored_to = Some(2);
        let pair = |newer, older, weight, verdict| LoopRecord {
            newer,
            older,
            overlap: 0.5,
            in_front: 0.0,
            inconsistency_sigmas: 0.2,
            residual_sigmas: 0.2,
            weight,
            verdict,
        };
        let loops = [pair(1, 0, 1.0, LoopVerdict::Accepted), pair(2, 0, 0.0, LoopVerdict::Outvoted)];
        let found = held(4, &loops, &keyframes);
        let components: Vec<u32> = (0..4).map(|submap| found.component(submap)).collect();
        assert_eq!(components, [0, 0, 2, 2]);
    }
}
