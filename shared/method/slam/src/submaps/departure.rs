//! Map departure (method 12.8): the camera is not where the map has it, carried away by what it is in, or taken for
//! being in a place that looks alike.
//!
//! Keyframes of long ago that should show what the frame shows are evidence for or against the map. The evidence
//! against it is a cumulative sum (Page 1954): it never falls below 0, so that it begins with the keyframe from which
//! on the map was wrong. Where it reaches its bound, a submap begins with that keyframe. If that was wrong, the next
//! place that both know joins them again.

use crate::estimation::FALSE_ALARMS;
use crate::evidence::pose_agreement::FAR_VOLUME;
use crate::evidence::same_place;
use crate::evidence::sequential::SequentialTest;
use crate::map::cause::Cause;
use crate::map::detection;
use crate::map::records::{ContradictionRecord, FrameRecord, MapChange, PoseRecord, SplitRecord};
use crate::map::state::KeyframeState;
use crate::map::submaps::Submaps;
use crate::map::view_limits::SAME_VIEW;
use crate::pairs::matchable::Matchable;
use crate::pairs::matching::Reach;
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::relocalise;
use crate::tracking::seen_pose::known_and_seen;
use crate::tracking::window::{self, Member};
use crate::tracking::window_alignment::reference;
use tessera_geometry::Pose;
use tessera_registration::Sampler;

/// The record with the evidence against the map so far, and with a split once that is certain.
pub(crate) fn with_departure(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    mut record: FrameRecord,
) -> FrameRecord {
    let state = input.map.state();
    let known = state.contradiction;
    let look = state
        .keyframes
        .last()
        .filter(|_| is_compared(input))
        .and_then(|newest| Some((newest.id, evidence(input, aligner, &record.pose)?)));
    let contradiction = match look {
        Some((newest, (seen, nats))) => ContradictionRecord::with(known.as_ref(), newest, (seen, -nats)),
        None => known,
    };
    record.change.contradiction = contradiction;
    // A cumulative sum that restarts at 0 comes to `ln(1 / p)` once in `1 / p` looks or less often (Page 1954, Lorden 1971).
    let is_certain = |known: &ContradictionRecord| known.sum_nats() >= -libm::log(FALSE_ALARMS);
    match contradiction.filter(is_certain) {
        // Drift misses what is near by the poses; what it sees is another part of the same map, unless frame after
        // frame is seen in another one.
        Some(_) if !is_sighted_elsewhere(input) && is_recognised(input, aligner) => {
            record.change.contradiction = None;
            record
        }
        Some(known) => with_split(input, record, &known),
        None => record,
    }
}

/// Whether a frame is compared with keyframes of long ago. The one that makes a keyframe has enough to do.
pub(crate) fn is_compared(input: &TrackingInput<'_>) -> bool {
    let is_able = input.context.mapping.submaps.after_s > 0.0;
    is_able && input.map.state().frames_since_keyframe == 1
}

/// Whether the last frames have their place in another component, by as much evidence as makes a sighting certain.
fn is_sighted_elsewhere(input: &TrackingInput<'_>) -> bool {
    let certain_nats = SequentialTest::accepted_nats();
    let is_other = |id: u32| input.map.keyframe(id).is_some_and(|k| !input.map.contains(k));
    let sighting = input.map.state().sighting;
    sighting.is_some_and(|sighting| sighting.evidence_nats() >= certain_nats && is_other(sighting.seen))
}

/// Whether the frame has its place among the keyframes of long ago, wherever they are.
fn is_recognised(input: &TrackingInput<'_>, aligner: &mut Aligner) -> bool {
    let old: Vec<&KeyframeState> = input.map.active().filter(|k| is_old(input, k)).collect();
    relocalise::glimpse(input, aligner, &old, |_, _| true).is_some()
}

/// The keyframe of long ago that is most like the frame in view, and what both show of one place, nats; `None` without
/// one, or without features.
///
/// Where features make a pose, it is where the track has it but by chance: the ratio of its density there over that
/// of any other place is evidence beside what the views show. A pose elsewhere may be drift, and tells nothing.
fn evidence(input: &TrackingInput<'_>, aligner: &mut Aligner, pose: &PoseRecord) -> Option<(u32, f64)> {
    if !input.context.mapping.features.enabled || !input.context.is_colour_trusted {
        return None;
    }
    let world_from_camera = &Pose::from(&pose.world_from_camera);
    let old = nearest_old(input, world_from_camera)?;
    let own = input.map.state().active().last().filter(|k| input.map.contains(k))?;
    let there = reference(input, Member::Keyframe(old.id))?;
    let pair = aligner.sight.pair(input.context, &there, world_from_camera, Reach::Anywhere);
    let pair = pair.filter(|pair| same_place::makes_pose(&pair.inliers, &pair.target_from_query));
    let old_from_camera = pair
        .as_ref()
        .map_or_else(|| there.world_from_camera.inverse() * world_from_camera, |pair| pair.target_from_query);
    let camera_from_own = world_from_camera.inverse() * Pose::from(&own.world_from_camera);
    let mut sampler = Sampler::default();
    let [query, target] =
        [own, old].map(|k| Matchable::new(input.context, &mut sampler, k, input.surfaces.keyframes));
    let mut matcher = input.context.matcher();
    let start = old_from_camera * camera_from_own;
    let (old_from_own, surfaces) = same_place::measure(&mut matcher, query.queries(), &target, &start);
    let at = old_from_own * camera_from_own.inverse();
    let n_agreeing = pair.as_ref().map_or(0, |pair| same_place::n_agreeing(&pair.inliers, &at));
    let n_seen = [aligner.sight.n_features(), there.features.len()];
    let before = before_newest(input).and_then(|k| reference(input, Member::Keyframe(k.id)));
    let n_expected = aligner.sight.n_expected(input.context, before.as_ref(), (&there, &at));
    let agree_near = || aligner.sight.agree_near(input.context, &there, &at);
    let evidence = surfaces.with_features(n_seen, (n_agreeing, n_expected), agree_near);
    // It may have come to where surfaces are the same.
    let views_nats = evidence.least_nats()?;
    let pose_nats = pair.and_then(|pair| {
        let [known, seen] = known_and_seen(input, old, &pair, pose)?;
        Some(known.coincidence_nats(&seen, FAR_VOLUME).max(0.0))
    });
    Some((old.id, views_nats + pose_nats.unwrap_or(0.0)))
}

/// The keyframe of the camera's map before the newest one, of those that were not culled.
fn before_newest<'a>(input: &TrackingInput<'a>) -> Option<&'a KeyframeState> {
    input.map.keyframes().rev().filter(|k| k.is_active()).nth(1)
}

fn is_old(input: &TrackingInput<'_>, keyframe: &KeyframeState) -> bool {
    detection::is_loop(&input.context.mapping.loops, input.map, keyframe, input.frame.index)
}

/// The keyframe of long ago whose view is the most like that of the frame.
fn nearest_old<'a>(input: &TrackingInput<'a>, view: &Pose) -> Option<&'a KeyframeState> {
    let near = window::near(&input.map, &SAME_VIEW, view);
    near.iter().filter_map(|(_, id)| input.map.keyframe(*id)).find(|k| is_old(input, k))
}

/// The record with a submap that begins with the newest keyframe. What was made since the evidence began is of
/// neither map for sure, and leaves the working map. Where the camera's submap had been joined to older ones, it is the
/// join that was wrong: all of that submap leaves them.
fn with_split(
    input: &TrackingInput<'_>,
    mut record: FrameRecord,
    known: &ContradictionRecord,
) -> FrameRecord {
    let state = input.map.state();
    let split = match (joined_since(&state.keyframes, &state.submaps), state.keyframes.last()) {
        (None, Some(newest)) if newest.id > known.first => {
            SplitRecord { carried: Some(known.first), first: newest.id }
        }
        (joined, _) => SplitRecord::since(joined.unwrap_or(known.first)),
    };
    let submap = state.submaps.n() + split.firsts().count() as u32 - 1;
    let (first, since, nats) = (split.first, known.first, known.sum_nats());
    record.causes.push(Cause::Departure { submap, first, since, nats });
    record.change = MapChange { contradiction: None, split: Some(split), ..record.change };
    FrameRecord { submap, ..record }
}

/// The first keyframe of the newest submap, where that was joined to older ones and is the last of a chain of them;
/// `None` where it was not joined, or has gone on from an older one since.
fn joined_since(keyframes: &[KeyframeState], submaps: &Submaps) -> Option<u32> {
    let submap = keyframes.last()?.submap;
    let n_own = keyframes.iter().rev().take_while(|k| k.submap == submap).count();
    let (before, own) = keyframes.split_at(keyframes.len() - n_own);
    let is_joined = before.iter().any(|k| submaps.component(k.submap) == submaps.component(submap));
    let is_chain = before.iter().all(|k| k.submap < submap);
    (is_joined && is_chain).then(|| own[0].id)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::keyframe;

    #[test]
    fn evidence_against_a_joined_submap_takes_its_join_back() {
        let made = |submaps: &[u32]| -> Vec<KeyframeState> {
            (0..).zip(submaps).map(|(id, &submap)| KeyframeState { submap, ..keyframe(id, 0, 0.0) }).collect()
        };
        let mut joined = Submaps::apart(3);
        joined.join(2, 0);
        assert_eq!(joined_since(&made(&[0, 0, 1, 2, 2]), &joined), Some(3));
        assert_eq!(joined_since(&made(&[0, 0, 1, 1]), &joined), None, "it is apart");
        assert_eq!(joined_since(&made(&[0, 2, 2, 0]), &joined), None, "it went on from the older one");
        assert_eq!(joined_since(&made(&[0, 0]), &joined), None);
    }
}
