//! Answers that another machine computed to a request of this run: what of them must hold before they are
//! used.

use crate::map::input_hash::input_hash;
use crate::map::records::{Correction, KeyframePose, LoopRecord, PairChanges, RequestRecord};
use crate::map::state::KeyframeState;
use crate::map::submaps::Submaps;

/// Largest coordinate of a pose, metres.
const MAX_COORDINATE_M: f64 = 1e6;

/// Checks an answer to a request with the keyframes and submaps that it asks for. The origin of each
/// component must stay where it is: an answer is in the gauge of the run that asks.
///
/// # Errors
/// Says what was found and what was expected.
pub(crate) fn check(
    request: &RequestRecord,
    (keyframes, submaps): (&[KeyframeState], &Submaps),
    answer: &Correction,
) -> Result<(), String> {
    if answer.request != request.request {
        return Err(format!("an answer to request {}, expected {}", answer.request, request.request));
    }
    let expected = input_hash(keyframes);
    if answer.input_hash != expected {
        let found = answer.input_hash;
        return Err(format!("an answer from other keyframes: input {found:016x}, expected {expected:016x}"));
    }
    if !answer.frames.is_empty() || answer.refinement.is_some() {
        return Err("poses of frames or a camera, which the run computes itself".to_owned());
    }
    check_submaps(submaps, &answer.submaps)?;
    check_poses(keyframes, &answer.keyframes)?;
    check_gauge(keyframes, answer)?;
    check_loops(keyframes.len(), &answer.loops)
}

fn check_submaps(expected: &Submaps, found: &Submaps) -> Result<(), String> {
    if found.n() != expected.n() {
        return Err(format!("{} submaps, expected {}", found.n(), expected.n()));
    }
    match found.is_consistent() {
        true => Ok(()),
        false => Err(format!("components that none can have: {found:?}")),
    }
}

/// A pose of each active keyframe at least, by id.
fn check_poses(keyframes: &[KeyframeState], poses: &[KeyframePose]) -> Result<(), String> {
    let is_rising = poses.is_sorted_by(|a, b| a.id < b.id);
    if !is_rising || poses.last().is_some_and(|pose| pose.id as usize >= keyframes.len()) {
        return Err(format!("poses that are not of {} keyframes, by id", keyframes.len()));
    }
    let is_named = |id: u32| poses.binary_search_by_key(&id, |pose| pose.id).is_ok();
    if let Some(missed) = keyframes.iter().find(|k| k.is_active() && !is_named(k.id)) {
        return Err(format!("no pose of keyframe {}, which was to be solved for", missed.id));
    }
    for KeyframePose { id, world_from_camera } in poses {
        let is_near = world_from_camera.translation_m.iter().all(|v| v.abs() <= MAX_COORDINATE_M);
        if !(is_near && world_from_camera.is_valid()) {
            return Err(format!("a pose that keyframe {id} cannot have: {world_from_camera:?}"));
        }
    }
    Ok(())
}

fn check_gauge(keyframes: &[KeyframeState], answer: &Correction) -> Result<(), String> {
    for origin in origins(keyframes, &answer.submaps) {
        let found = answer.keyframes.iter().find(|pose| pose.id as usize == origin);
        if found.is_none_or(|pose| pose.world_from_camera != keyframes[origin].world_from_camera) {
            return Err(format!("keyframe {origin} moves, which is the origin of its map"));
        }
    }
    Ok(())
}

/// Places of the first active keyframe of each component: the origins of the gauges.
pub(crate) fn origins(keyframes: &[KeyframeState], submaps: &Submaps) -> Vec<usize> {
    let mut seen = std::collections::BTreeSet::new();
    let active = keyframes.iter().enumerate().filter(|(_, k)| k.is_active());
    active.filter(|(_, k)| seen.insert(submaps.component(k.submap))).map(|(place, _)| place).collect()
}

fn check_loops(n_keyframes: usize, loops: &[LoopRecord]) -> Result<(), String> {
    if loops.len() > n_keyframes * n_keyframes {
        return Err(format!("{} loops of {n_keyframes} keyframes", loops.len()));
    }
    let is_share = |v: f64| (0.0..=1.0).contains(&v);
    let is_wrong = |l: &&LoopRecord| {
        let is_known = (l.newer.max(l.older) as usize) < n_keyframes && l.newer != l.older;
        !(is_known && is_share(l.overlap) && is_share(l.in_front) && is_share(l.weight))
    };
    match loops.iter().find(is_wrong) {
        None => Ok(()),
        Some(found) => Err(format!("a loop that none can be among {n_keyframes} keyframes: {found:?}")),
    }
}

/// Pairs among so many keyframes, those that are no more by id.
pub(crate) fn check_pairs(n_keyframes: usize, changes: &PairChanges) -> Result<(), String> {
    let searched = changes.searched.iter().map(|pair| (pair.newer, pair.older));
    let is_pair = |(newer, older): (u32, u32)| newer != older && (newer.max(older) as usize) < n_keyframes;
    match searched.chain(changes.dropped.iter().copied()).find(|pair| !is_pair(*pair)) {
        Some((newer, older)) => {
            Err(format!("a pair of keyframes {newer} and {older}, expected two of {n_keyframes}"))
        }
        None if !changes.dropped.is_sorted() => Err("pairs that are no more, not by id".to_owned()),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::records::{LoopVerdict, MatchPose, MatchRecord};
    use crate::map::test_wall::keyframe;
    use tessera_geometry::{Pose, PoseBits};

    const REQUEST: RequestRecord =
        RequestRecord { request: 3, n_keyframes: 4, effective_before: 9, is_final: false };

    type Change<'a> = &'a dyn Fn(&mut Correction);

    fn at(x_m: f64) -> PoseBits {
        PoseBits::from(&Pose::translation(x_m, 0.0, 0.0))
    }

    fn answer(keyframes: &[KeyframeState]) -> Correction {
        let pose = |k: &KeyframeState| KeyframePose { id: k.id, world_from_camera: k.world_from_camera };
        let pair = LoopRecord {
            newer: 2,
            older: 0,
            overlap: 0.5,
            in_front: 0.0,
            inconsistency_sigmas: 0.1,
            residual_sigmas: 0.1,
            weight: 1.0,
            verdict: LoopVerdict::Accepted,
        };
        Correction {
            request: 3,
            input_hash: input_hash(keyframes),
            keyframes: keyframes.iter().map(pose).collect(),
            loops: vec![pair],
            submaps: Submaps::apart(1),
            ..Correction::default()
        }
    }

    #[test]
    fn pairs_are_of_two_keyframes_of_the_run() {
        let at = MatchPose::of(&Pose::identity());
        let refusal = |searched: &[(u32, u32)], dropped: &[(u32, u32)]| {
            let searched = searched.iter().map(|&(newer, older)| MatchRecord { newer, older, at }).collect();
            check_pairs(4, &PairChanges { searched, dropped: dropped.to_vec() }).err().unwrap_or_default()
        };
        assert_eq!(refusal(&[(3, 1), (2, 0)], &[(1, 0), (2, 1)]), "");
        assert!(refusal(&[(4, 1)], &[]).contains("keyframes 4 and 1, expected two of 4"));
        assert!(refusal(&[], &[(2, 2)]).contains("keyframes 2 and 2"));
        assert!(refusal(&[], &[(2, 1), (1, 0)]).contains("not by id"));
    }

    #[test]
    fn an_answer_is_used_only_where_it_fits_the_request() {
        let mut keyframes =
            [keyframe(0, 0, 0.0), keyframe(1, 0, 1.0), keyframe(2, 0, 2.0), keyframe(3, 0, 3.0)];
        keyframes[1].anchored_to = Some(2);
        let submaps = Submaps::apart(1);
        let refusal = |change: Change<'_>| {
            let mut changed = answer(&keyframes);
            change(&mut changed);
            check(&REQUEST, (&keyframes, &submaps), &changed).err().unwrap_or_default()
        };
        assert_eq!(refusal(&|_| ()), "");
        assert_eq!(refusal(&|a| a.keyframes[2].world_from_camera = at(2.5)), "");
        assert_eq!(refusal(&|a| a.keyframes.retain(|k| k.id != 1)), "", "a culled one moves along");
        let cases: [(Change<'_>, &str); 13] = [
            (&|a| a.request = 2, "request 2, expected 3"),
            (&|a| a.input_hash ^= 1, "other keyframes"),
            (&|a| a.frames.push((0, at(0.0))), "poses of frames"),
            (&|a| a.submaps = Submaps::apart(2), "2 submaps, expected 1"),
            (&|a| a.keyframes.truncate(3), "no pose of keyframe 3"),
            (&|a| a.keyframes.swap(1, 2), "not of 4 keyframes, by id"),
            (&|a| a.keyframes[3].id = 4, "not of 4 keyframes, by id"),
            (&|a| a.keyframes[1].world_from_camera = at(f64::NAN), "keyframe 1 cannot have"),
            (&|a| a.keyframes[1].world_from_camera = at(1e9), "keyframe 1 cannot have"),
            (&|a| a.keyframes[1].world_from_camera.rotation_xyzw[3] = 1.1, "keyframe 1 cannot have"),
            (&|a| a.keyframes[0].world_from_camera = at(0.1), "keyframe 0 moves"),
            (&|a| a.loops[0].newer = 4, "a loop that none can be"),
            (&|a| a.loops[0].weight = f64::NAN, "a loop that none can be"),
        ];
        for (change, words) in cases {
            let said = refusal(change);
            assert!(said.contains(words), "{words}: {said:?}");
        }
    }
}
