//! Noticing that the camera is elsewhere than the map has it (method 12.8): carried away by what it stands
//! in, such as a lift, or taken for being in a place that looks alike.
//!
//! Nothing of the motion itself is seen. What is seen is that keyframes of long ago, which look at the same
//! place by their poses, are missed: their features are not there, nor do their surfaces fit, for what the
//! camera sees stands where they saw free space. One of them may have been blocked by a door; many of them
//! along a way, and hardly one between them that is seen, say that the place is another one. The camera then
//! goes on in a submap of its own, to which the keyframes belong that were made since. If that was wrong, the
//! next place that both know joins them again.

use crate::features::matching::Reach;
use crate::features::sight::ENOUGH_FEATURES;
use crate::loops::detection;
use crate::loops::matchable::Matchable;
use crate::loops::verification;
use crate::loops::view_limits::ViewLimits;
use crate::map::records::{ContradictionRecord, FrameRecord, SplitRecord};
use crate::map::state::KeyframeState;
use crate::settings::GlobalSettings;
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::relocalise;
use crate::tracking::window::{self, Member};
use crate::tracking::window_alignment::{WindowAlignment, reference};
use nalgebra::Vector3;
use tessera_geometry::Pose;
use tessera_registration::Sampler;

/// Keyframes of long ago that look at what the frame looks at.
const SAME_VIEW: ViewLimits = ViewLimits { radius_m: 0.7, angle_rad: 25.0_f64.to_radians() };
/// Features on which a frame and a keyframe of the same place agree, wherever they see each other.
const MIN_AGREEING: usize = 15;
/// Share of the matches of the best member of a window from which on an old one fits.
const FITS: f64 = 0.5;
/// Keyframes that are missed before the camera is taken to be elsewhere, and its way meanwhile, metres.
const MISSED: u32 = 12;
const WAY_M: f64 = 1.5;
/// Misses that one keyframe takes back which is seen: a room that looks alike may be in view for a moment.
const SEEN: u32 = 4;
/// Time without a new keyframe after which the camera stood, nanoseconds.
const STOOD_NANOS: i64 = 2_000_000_000;
/// Time from then to the first miss, at most, nanoseconds.
const SOON_NANOS: i64 = 3_000_000_000;

/// The record with what the frame says of old keyframes, and with a split once that is certain.
pub(crate) fn with_contradiction(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    aligned: &WindowAlignment,
    record: FrameRecord,
) -> FrameRecord {
    let known = input.map.state().contradiction;
    let contradiction = match &record.new_keyframe {
        // A correction decides on poses that are in doubt.
        Some(keyframe) if record.moved.is_empty() => {
            match look(input, aligner, aligned, &Pose::from(&record.world_from_camera)) {
                Look::Seen => known.and_then(|known| {
                    let n_missed = known.n_missed.checked_sub(SEEN)?;
                    Some(ContradictionRecord { n_missed, ..known })
                }),
                Look::Missed => Some(match known {
                    Some(known) => {
                        ContradictionRecord { n_missed: known.n_missed.saturating_add(1), ..known }
                    }
                    None => ContradictionRecord { first: keyframe.id, n_missed: 1 },
                }),
                Look::Nothing => known,
            }
        }
        _ => known,
    };
    let record = FrameRecord { contradiction, ..record };
    match contradiction.and_then(|known| split(input, &record, &known)) {
        // A drift of a metre misses what is near by the poses; what it sees is another part of the same map.
        Some(_) if is_recognised(input, aligner) => FrameRecord { contradiction: None, ..record },
        Some(split) => with_split(input, record, split),
        None => record,
    }
}

/// Whether the frame has its place among the keyframes of long ago, wherever they are.
fn is_recognised(input: &TrackingInput<'_>, aligner: &mut Aligner) -> bool {
    let old: Vec<&KeyframeState> = input.map.active().filter(|k| is_old(input, k)).collect();
    relocalise::glimpse(input, aligner, &old, |_, _| true).is_some()
}

/// What a frame says of a keyframe of long ago.
enum Look {
    Seen,
    Missed,
    Nothing,
}

fn look(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    aligned: &WindowAlignment,
    world_from_camera: &Pose,
) -> Look {
    let settings = &input.context.mapping;
    let is_able =
        settings.features.enabled && input.context.is_colour_trusted && settings.submaps.after_s > 0.0;
    if !is_able || aligner.sight.n_features() < ENOUGH_FEATURES {
        return Look::Nothing;
    }
    if let Some(known) = in_window(input, aligner, aligned) {
        return known;
    }
    let Some(old) = nearest_old(input, world_from_camera) else { return Look::Nothing };
    let Some(there) = reference(input, Member::Keyframe(old.id)) else { return Look::Nothing };
    if there.features.len() < ENOUGH_FEATURES {
        return Look::Nothing;
    }
    let pair = aligner.sight.pair(input.context, &there, world_from_camera, Reach::ANYWHERE);
    let seen = pair.filter(|pair| pair.inliers.len() >= MIN_AGREEING).map(|pair| pair.target_from_query);
    let Some(own) = input.map.state().active().last().filter(|k| input.map.contains(k)) else {
        return Look::Nothing;
    };
    let old_from_world = Pose::from(&old.world_from_camera).inverse();
    let camera_from_own = world_from_camera.inverse() * Pose::from(&own.world_from_camera);
    let old_from_own = seen.unwrap_or(old_from_world * world_from_camera) * camera_from_own;
    let mut sampler = Sampler::default();
    let sides = [own, old].map(|k| Matchable::new(input.context, &mut sampler, k, input.surfaces.keyframes));
    let global = &settings.global;
    let tested =
        verification::test(global, &mut input.context.matcher(), &sides[0], &sides[1], &old_from_own);
    // What stands in the way of some is no other place.
    match (seen, tested.in_front > GlobalSettings::MAX_IN_FRONT) {
        (Some(_), false) => Look::Seen,
        (None, true) => Look::Missed,
        (Some(_), true) | (None, false) => Look::Nothing,
    }
}

/// What the window's own alignment says: an old keyframe in it is seen where its features agree with the
/// pose, and says nothing where its surface alone fits. `None`: none of them does.
fn in_window(input: &TrackingInput<'_>, aligner: &Aligner, aligned: &WindowAlignment) -> Option<Look> {
    let most = aligned.alignment.blocks.iter().map(|(_, sums)| sums.n).max().unwrap_or(0);
    let mut fits = false;
    for (member, (_, sums)) in aligned.members.iter().zip(&aligned.alignment.blocks) {
        let Member::Keyframe(id) = member else { continue };
        let Some(old) = input.map.keyframe(*id).filter(|k| is_old(input, k)) else { continue };
        let at = Pose::from(&old.world_from_camera).inverse() * aligned.alignment.world_from_camera;
        if f64::from(sums.n) < FITS * f64::from(most) {
            continue;
        }
        if aligner.sight.n_agreeing_with((true, u64::from(old.id)), &at) >= MIN_AGREEING {
            return Some(Look::Seen);
        }
        fits = true;
    }
    fits.then_some(Look::Nothing)
}

fn is_old(input: &TrackingInput<'_>, keyframe: &KeyframeState) -> bool {
    detection::is_loop(&input.context.mapping.loops, input.map, keyframe, input.frame.index)
}

/// The keyframe of long ago whose view is the most like that of the frame.
fn nearest_old<'a>(input: &TrackingInput<'a>, view: &Pose) -> Option<&'a KeyframeState> {
    let near = window::near(&input.map, &SAME_VIEW, view);
    near.iter().filter_map(|(_, id)| input.map.keyframe(*id)).find(|k| is_old(input, k))
}

/// Where the camera left its submap, once enough is missed along a way.
fn split(
    input: &TrackingInput<'_>,
    record: &FrameRecord,
    known: &ContradictionRecord,
) -> Option<SplitRecord> {
    let keyframes = &input.map.state().keyframes;
    let start = keyframes.get(known.first as usize)?;
    let way = Vector3::from(record.world_from_camera.translation_m)
        - Vector3::from(start.world_from_camera.translation_m);
    (known.n_missed >= MISSED && way.norm() >= WAY_M).then(|| border(keyframes, known.first))
}

/// Which of the latest keyframes are of new submaps, where the first miss was with this one. Where the camera
/// stood just before, or stood after, it stood in something that moved.
fn border(keyframes: &[KeyframeState], first: u32) -> SplitRecord {
    let start = &keyframes[first as usize];
    let is_of_submap = |k: &KeyframeState| k.submap == start.submap;
    let is_soon =
        |k: &&KeyframeState| is_of_submap(k) && start.stamp_nanos.saturating_sub(k.stamp_nanos) <= SOON_NANOS;
    let n_before = keyframes[..first as usize].iter().rev().take_while(is_soon).count();
    let from = (first as usize - n_before).saturating_sub(1);
    let is_pause = |pair: &&[KeyframeState]| {
        is_of_submap(&pair[0]) && pair[1].stamp_nanos.saturating_sub(pair[0].stamp_nanos) >= STOOD_NANOS
    };
    match keyframes[from..].windows(2).rfind(is_pause) {
        Some(pause) => SplitRecord { carried: Some(first.min(pause[0].id)), first: pause[1].id },
        None => SplitRecord { carried: None, first },
    }
}

fn with_split(input: &TrackingInput<'_>, record: FrameRecord, split: SplitRecord) -> FrameRecord {
    let submap = input.map.state().submaps.n() + split.firsts().count() as u32 - 1;
    let n_missed = record.contradiction.map_or(0, |known| known.n_missed);
    let carried = split.carried.map_or(String::new(), |first| {
        format!(", and before that from keyframe {first} on in something that moved")
    });
    let said = format!(
        "submap {submap} begins with keyframe {}: {n_missed} keyframes of long ago are not seen where they should be{carried}",
        split.first
    );
    let reason = if record.reason.is_empty() { said } else { format!("{}; {said}", record.reason) };
    FrameRecord { reason, submap, contradiction: None, split: Some(split), ..record }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loops::test_wall::keyframe;

    /// Keyframes at these times, seconds.
    fn at(seconds: &[i64]) -> Vec<KeyframeState> {
        let made = |(id, s): (u32, &i64)| KeyframeState {
            stamp_nanos: s * 1_000_000_000,
            ..keyframe(id, 0, f64::from(id))
        };
        (0..).zip(seconds).map(made).collect()
    }

    #[test]
    fn a_submap_begins_with_the_first_miss_and_another_where_the_camera_had_stood() {
        let walk = at(&[0, 1, 2, 3, 4, 5]);
        assert_eq!(border(&walk, 3), SplitRecord { carried: None, first: 3 });
        // It stood after the first miss, before it, and long before it.
        let ride = at(&[0, 1, 2, 12, 13, 14]);
        assert_eq!(border(&ride, 1), SplitRecord { carried: Some(1), first: 3 });
        assert_eq!(border(&ride, 4), SplitRecord { carried: Some(2), first: 3 });
        let later = at(&[0, 10, 11, 12, 13, 14, 15]);
        assert_eq!(border(&later, 6), SplitRecord { carried: None, first: 6 });
        let mut lost = ride;
        lost[..3].iter_mut().for_each(|k| k.submap = 7);
        assert_eq!(border(&lost, 3), SplitRecord { carried: None, first: 3 });
        assert_eq!(border(&at(&[0]), 0), SplitRecord { carried: None, first: 0 });
    }
}
