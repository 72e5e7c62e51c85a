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
use crate::loops::join::saying;
use crate::loops::matchable::Matchable;
use crate::loops::pair_alignment::PairAlignment;
use crate::loops::verification;
use crate::loops::view_limits::ViewLimits;
use crate::map::context::Context;
use crate::map::records::{ContradictionRecord, FrameRecord, SplitRecord};
use crate::map::state::KeyframeState;
use crate::settings::GlobalSettings;
use crate::tracking::alignment::Aligner;
use crate::tracking::degeneracy::is_determined;
use crate::tracking::input::TrackingInput;
use crate::tracking::relocalise;
use crate::tracking::stand::{Made, border, border_long_ago, joined_since, stand, stood_long_ago};
use crate::tracking::window::{self, Member};
use crate::tracking::window_alignment::{WindowAlignment, reference};
use nalgebra::Vector3;
use tessera_geometry::{Pose, translation_rotation_norms};
use tessera_registration::{MatchLimits, Sampler};

/// Keyframes of long ago that look at what the frame looks at.
const SAME_VIEW: ViewLimits = ViewLimits { radius_m: 0.7, angle_rad: 25.0_f64.to_radians() };
/// The same where none is that near and the camera had stood just before: a door that opens may have carried it
/// along.
const SAME_VIEW_BEHIND_A_STAND: ViewLimits = ViewLimits { radius_m: 1.2, ..SAME_VIEW };
/// One that looks the same wherever features are seen at all.
const SAME_LOOK: ViewLimits = ViewLimits { radius_m: 0.3, angle_rad: 15.0_f64.to_radians() };
/// Features on which a frame and a keyframe of the same place agree, wherever they see each other.
const MIN_AGREEING: usize = 15;
/// Keyframes of long ago that must all look otherwise, at most.
const MOST_LOOKED_AT: usize = 3;
/// Features that agree with a member of the window, where they are seen well enough to be missed elsewhere.
const MIN_FOLLOWED: u32 = 15;
/// How fast a camera turns whose image is blurred, and unlike a sharp one of the same place, radians a second.
const BLURRED_RAD_PER_S: f64 = 0.7;
/// Share of the matches of the best member of a window from which on an old one fits.
const FITS: f64 = 0.5;
/// Keyframes that are missed before the camera is taken to be elsewhere, and its way meanwhile, metres.
const MISSED: u32 = 12;
const WAY_M: f64 = 1.5;
/// Keyframes that are missed where the camera had stood just before: what it stood in may have moved.
const MISSED_BEHIND_A_STAND: u32 = 6;
/// Time from the first of them to the decision, nanoseconds: by then a door has opened.
const LOOKED_NANOS: i64 = 2_000_000_000;
/// Misses that one keyframe takes back which is seen: a room that looks alike may be in view for a moment.
const SEEN: u32 = 4;

/// The record with what the frame says of old keyframes, and with a split once that is certain.
pub(crate) fn with_contradiction(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    aligned: &WindowAlignment,
    record: FrameRecord,
) -> FrameRecord {
    let state = input.map.state();
    let known = state.contradiction;
    let contradiction = match state.keyframes.last() {
        Some(newest) if is_compared(input, &record) => {
            match look(input, aligner, aligned, &Pose::from(&record.world_from_camera)) {
                Look::Seen => known.and_then(|known| {
                    let n_missed = known.n_missed.checked_sub(SEEN)?;
                    Some(ContradictionRecord { n_missed, ..known })
                }),
                Look::Missed => Some(match known {
                    Some(known) => {
                        ContradictionRecord { n_missed: known.n_missed.saturating_add(1), ..known }
                    }
                    None => ContradictionRecord { first: newest.id, n_missed: 1 },
                }),
                Look::Nothing => known,
            }
        }
        _ => known,
    };
    let record = FrameRecord { contradiction, ..record };
    match contradiction.and_then(|known| split(input, &record, &known)) {
        // A drift of a metre misses what is near by the poses; what it sees is another part of the same map, unless
        // frame after frame is seen in another one.
        Some(_) if !is_sighted_elsewhere(input) && is_recognised(input, aligner) => {
            FrameRecord { contradiction: None, ..record }
        }
        Some(split) => with_split(input, record, split),
        None => record,
    }
}

/// Whether a frame is compared with keyframes of long ago. The one that makes a keyframe has enough to do, and a
/// correction decides on poses that are in doubt.
pub(crate) fn is_compared(input: &TrackingInput<'_>, record: &FrameRecord) -> bool {
    input.map.state().frames_since_keyframe == 1 && record.moved.is_empty()
}

/// Whether the last frames have their place in another component, as often as makes a sighting certain.
fn is_sighted_elsewhere(input: &TrackingInput<'_>) -> bool {
    let n_certain = input.context.mapping.relocalise.confirm_frames;
    let is_other = |id: u32| input.map.keyframe(id).is_some_and(|k| !input.map.contains(k));
    let sighting = input.map.state().sighting;
    sighting.is_some_and(|sighting| sighting.n_confirmed >= n_certain && is_other(sighting.seen))
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
    let fitting = match in_window(input, aligner, aligned) {
        Some(InWindow::Seen) => return Look::Seen,
        Some(InWindow::Fits(old)) => Some(old),
        None => None,
    };
    let Some(old) = fitting.or_else(|| nearest_old(input, world_from_camera)) else { return Look::Nothing };
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
    if seen.is_none() {
        // Along bare walls the map may have slid, and is the same place for all that. What the camera stood in
        // has moved along all of them.
        if !has_stood(input) && !are_determined(input.context, &sides, &old_from_own) {
            return Look::Nothing;
        }
        let is_blurred = aligned.alignment.velocity.phi.norm() > BLURRED_RAD_PER_S;
        let is_followed = aligned.alignment.n_agreeing >= MIN_FOLLOWED && !is_blurred;
        if is_followed && looks_otherwise(input, aligner, world_from_camera) {
            return Look::Missed;
        }
    }
    if fitting.is_some() {
        return Look::Nothing;
    }
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

/// What a window's alignment says of an old keyframe in it.
enum InWindow<'a> {
    /// Its features agree with the pose.
    Seen,
    /// Its surface alone fits.
    Fits(&'a KeyframeState),
}

/// What the window's own alignment says; `None`: no old keyframe in it fits.
fn in_window<'a>(
    input: &TrackingInput<'a>,
    aligner: &Aligner,
    aligned: &WindowAlignment,
) -> Option<InWindow<'a>> {
    let most = aligned.alignment.blocks.iter().map(|(_, sums)| sums.n).max().unwrap_or(0);
    let mut fits = None;
    for (member, (_, sums)) in aligned.members.iter().zip(&aligned.alignment.blocks) {
        let Member::Keyframe(id) = member else { continue };
        let Some(old) = input.map.keyframe(*id).filter(|k| is_old(input, k)) else { continue };
        let at = Pose::from(&old.world_from_camera).inverse() * aligned.alignment.world_from_camera;
        if f64::from(sums.n) < FITS * f64::from(most) {
            continue;
        }
        if aligner.sight.n_agreeing_with((true, u64::from(old.id)), &at) >= MIN_AGREEING {
            return Some(InWindow::Seen);
        }
        fits = fits.or(Some(InWindow::Fits(old)));
    }
    fits
}

/// Whether the surfaces of two keyframes hold each other in every direction.
fn are_determined(context: &Context, [query, target]: &[Matchable<'_>; 2], target_from_query: &Pose) -> bool {
    let limits = |tightness: f32| MatchLimits::drifted(GlobalSettings::FIRST_DISTANCE_M, tightness);
    let pair = PairAlignment {
        query: &query.queries,
        target,
        n_queries: GlobalSettings::QUERIES_PER_PAIR,
        limits: &limits,
    };
    let (block, _) = pair.search(&mut context.matcher(), target_from_query, 1.0);
    is_determined(context, &block.linearise(target_from_query).0)
}

/// Whether the camera stood just before the first keyframe that missed one, or before the newest.
fn has_stood(input: &TrackingInput<'_>) -> bool {
    let state = input.map.state();
    let Some(newest) = state.keyframes.len().checked_sub(1) else { return false };
    let first = state.contradiction.map_or(newest, |known| (known.first as usize).min(newest));
    // Those of long before say nothing, and are many.
    let at = Made::of(&state.keyframes[first]);
    let before = state.keyframes[..first].iter().rposition(|k| !Made::of(k).is_soon_before(&at)).unwrap_or(0);
    let made: Vec<Made> = state.keyframes[before..].iter().map(Made::of).collect();
    stand(&made, first - before).is_some()
}

/// Whether walls of the same shape look otherwise: of the keyframes of long ago that saw the same from nearly the
/// same place none shares features, wherever they are looked for.
fn looks_otherwise(input: &TrackingInput<'_>, aligner: &mut Aligner, view: &Pose) -> bool {
    let near = window::near(&input.map, &SAME_LOOK, view);
    let old = near.iter().filter_map(|(_, id)| input.map.keyframe(*id)).filter(|k| is_old(input, k));
    let references = old.take(MOST_LOOKED_AT).filter_map(|k| reference(input, Member::Keyframe(k.id)));
    let mut n_missed = 0;
    for there in references.filter(|there| there.features.len() >= ENOUGH_FEATURES) {
        let is_upright = turn_between(&there.world_from_camera, view) <= SAME_LOOK.angle_rad;
        let pair = aligner.sight.pair(input.context, &there, view, Reach::ANYWHERE);
        if pair.is_some_and(|pair| pair.inliers.len() >= MIN_AGREEING) {
            return false;
        }
        n_missed += u32::from(is_upright);
    }
    n_missed > 0
}

/// The whole turn from one camera to another, that about the optical axis among it, radians.
fn turn_between(a: &Pose, b: &Pose) -> f64 {
    translation_rotation_norms(&(a.inverse() * b)).1
}

fn is_old(input: &TrackingInput<'_>, keyframe: &KeyframeState) -> bool {
    detection::is_loop(&input.context.mapping.loops, input.map, keyframe, input.frame.index)
}

/// The keyframe of long ago whose view is the most like that of the frame.
fn nearest_old<'a>(input: &TrackingInput<'a>, view: &Pose) -> Option<&'a KeyframeState> {
    let nearest = |limits: &ViewLimits| {
        let near = window::near(&input.map, limits, view);
        near.iter().filter_map(|(_, id)| input.map.keyframe(*id)).find(|k| is_old(input, k))
    };
    nearest(&SAME_VIEW).or_else(|| has_stood(input).then(|| nearest(&SAME_VIEW_BEHIND_A_STAND)).flatten())
}

/// Where the camera left its submap, once enough is missed along a way, or behind a stand.
fn split(
    input: &TrackingInput<'_>,
    record: &FrameRecord,
    known: &ContradictionRecord,
) -> Option<SplitRecord> {
    let keyframes = &input.map.state().keyframes;
    let new = record.new_keyframe.as_ref().map(|k| Made {
        id: k.id,
        stamp_nanos: k.stamp_nanos,
        session: input.map.state().session,
        submap: record.submap,
    });
    let start = keyframes.get(known.first as usize).filter(|_| known.n_missed >= MISSED_BEHIND_A_STAND)?;
    let way = Vector3::from(record.world_from_camera.translation_m)
        - Vector3::from(start.world_from_camera.translation_m);
    let is_along_a_way = known.n_missed >= MISSED && way.norm() >= WAY_M;
    let made: Vec<Made> = keyframes.iter().map(Made::of).chain(new).collect();
    let first = known.first as usize;
    let stood = stand(&made, first);
    let has_looked =
        |stood: usize| record.stamp_nanos.saturating_sub(made[stood + 1].stamp_nanos) >= LOOKED_NANOS;
    if is_along_a_way && stood.is_none() {
        let joined = joined_since(&made, &input.map.state().submaps);
        return Some(match stood_long_ago(&made, first) {
            Some(stood) => border_long_ago(&made, (first, stood), joined),
            None => SplitRecord::since(joined.unwrap_or(start.id)),
        });
    }
    stood.filter(|stood| is_along_a_way || has_looked(*stood)).map(|stood| border(&made, first, stood))
}

fn with_split(input: &TrackingInput<'_>, record: FrameRecord, split: SplitRecord) -> FrameRecord {
    let submap = input.map.state().submaps.n() + split.firsts().count() as u32 - 1;
    let n_missed = record.contradiction.map_or(0, |known| known.n_missed);
    let carried = split.carried.map_or(String::new(), |first| {
        format!(", and before that from keyframe {first} on in something that moved")
    });
    let before = split
        .before
        .map_or(String::new(), |first| format!("; what was joined with keyframe {first} is apart again"));
    let said = format!(
        "submap {submap} begins with keyframe {}: {n_missed} keyframes of long ago are not seen where they should be{carried}{before}",
        split.first
    );
    FrameRecord { submap, contradiction: None, split: Some(split), ..saying(record, &said) }
}
