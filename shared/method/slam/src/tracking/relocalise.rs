//! Relocalisation: the place in the map of a frame that could not be tracked.
//!
//! Candidates are the last pose, the keyframes that show most of the frame's features, and those whose fern codes are
//! most similar. A candidate must pass the strict tests once aligned, and the map changes again only after several
//! frames in a row have passed.
//!
//! Where relocalisation was asked for, the last pose is no candidate until a place is found.

use crate::evidence::pose_agreement::FAR_VOLUME;
use crate::evidence::sequential::{SequentialTest, TestVerdict};
use crate::map::appearance::similarity;
use crate::map::cause::{CandidatePlace, Cause};
use crate::map::records::{FrameRecord, State};
use crate::map::state::KeyframeState;
use crate::pairs::keyframe_pair::MIN_FEATURES;
use crate::pairs::matching::{LEAST_OF_POSE, Reach};
use crate::tracking::acceptance;
use crate::tracking::alignment::Aligner;
use crate::tracking::found_place::{self, Shown};
use crate::tracking::input::TrackingInput;
use crate::tracking::motion_model::{place, widened};
use crate::tracking::prediction::Prediction;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::{
    WindowAlignment, align_coarse_to_fine, align_to, nearby_keyframes, reference,
};
use tessera_geometry::Pose;

/// A pose from which an alignment is tried.
struct Candidate {
    guess: Pose,
    /// The submap that it is in.
    submap: u32,
    place: CandidatePlace,
    is_last_pose: bool,
}

impl Candidate {
    fn at(world_from_camera: Pose, submap: u32, place: CandidatePlace) -> Self {
        Self { guess: world_from_camera, submap, place, is_last_pose: false }
    }
}

/// Whether the frame is the first one aligned since relocalisation was asked for.
pub(crate) fn is_asked(input: &TrackingInput<'_>) -> bool {
    let (asked_from, index) = (input.frame.relocalise_from, input.frame.index);
    let last = input.map.state().recent.last();
    asked_from <= index && last.is_some_and(|last| last.index < asked_from)
}

/// The record of such a frame, with the request as its first cause whatever the outcome.
pub(crate) fn noted(mut record: FrameRecord) -> FrameRecord {
    if !record.is_relocalisation_asked() {
        record.causes.insert(0, Cause::RelocalisationAsked);
    }
    record
}

/// Tracking after the place was found, until the frames show enough of it (method 12.7).
pub(crate) fn confirm(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Result<WindowAlignment, Cause> {
    let members = nearby_keyframes(input, &prediction.world_from_camera, usize::MAX);
    let found = align_to(input, aligner, members, input.samples, &widened(input, prediction));
    let shown = found_place::shown(input, aligner, &found).ok_or(Cause::NoKeyframe)?;
    match shown {
        Shown::Evidence(_) => acceptance::tracking(&input.context.mapping.window, &found.alignment, None)?,
        Shown::SurfacesAlone => acceptance::strict(&found.alignment).map(drop)?,
    }
    let test = found_place::with_frame(input, aligner, &found, shown);
    if test.sum_nats <= 0.0 {
        return Err(Cause::PlaceRefuted(test.sum_nats));
    }
    Ok(as_far_as_certain(found, test, Vec::new()))
}

/// The frame with what is known of its place: tracked once that is certain.
fn as_far_as_certain(
    found: WindowAlignment,
    test: SequentialTest,
    mut causes: Vec<Cause>,
) -> WindowAlignment {
    let is_certain = test.verdict() == TestVerdict::Accepted;
    let (sum_nats, bound_nats) = (test.sum_nats, SequentialTest::accepted_nats());
    causes.push(Cause::Confirmed { sum_nats, bound_nats });
    let (state, evidence_nats) =
        if is_certain { (State::Tracking, 0.0) } else { (State::Relocalising, sum_nats) };
    WindowAlignment { state, causes, evidence_nats, ..found }
}

/// The first candidate that passes. The error has why the frame was lost, and that none did.
pub(crate) fn relocalise(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
    why_lost: Cause,
) -> Result<WindowAlignment, Vec<Cause>> {
    if !input.context.mapping.relocalise.enabled {
        return Err(vec![why_lost]);
    }
    let anywhere: Vec<&KeyframeState> = input.map.active_anywhere().collect();
    let mut candidates = seen_candidates(input, aligner, &anywhere, input.map.state().n_lost as usize);
    candidates.extend(supposed_candidates(input, &anywhere, prediction));
    let n_candidates = candidates.len() as u32;
    let motion_nats = |found: &WindowAlignment| motion_nats(input, prediction, found);
    let Some(FoundPlace { found, how }) = first_that_fits(input, aligner, candidates, motion_nats) else {
        return Err(vec![why_lost, Cause::NoPlaceFits(n_candidates)]);
    };
    let test = SequentialTest::default().with(found.evidence_nats, 1.0);
    Ok(as_far_as_certain(found, test, vec![why_lost, how]))
}

/// Evidence of a place by the motion before it, nats: behind some images without depth the camera is where it was going,
/// the less certainly the longer they last.
fn motion_nats(input: &TrackingInput<'_>, prediction: &Prediction, found: &WindowAlignment) -> f64 {
    let state = input.map.state();
    let component = |submap| state.submaps.component(submap);
    let is_led_to = component(found.submap) == component(input.map.submap());
    let is_dropped = state.is_pose_dropped || is_asked(input);
    let motion = prediction.motion.as_ref().filter(|_| is_led_to && !is_dropped);
    motion.map_or(0.0, |motion| motion.track_nats(&found.alignment.world_from_camera, FAR_VOLUME).max(0.0))
}

/// The place of a frame among these keyframes, wherever they are. `turn` goes through all of them.
pub(crate) fn recognise(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    keyframes: &[&KeyframeState],
    turn: usize,
) -> Option<WindowAlignment> {
    let mut candidates = seen_candidates(input, aligner, keyframes, turn);
    candidates.extend(similar_keyframes(input, keyframes));
    first_that_fits(input, aligner, candidates, |_| 0.0).map(|place| place.found)
}

/// The place of a frame among these keyframes by features alone, at the cost of a search and of a match with
/// the most promising keyframes: for frames that are tracked, and have no time for more. `is_worth_while` is
/// asked with a pose there and its submap before surfaces are aligned.
pub(crate) fn glimpse(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    keyframes: &[&KeyframeState],
    is_worth_while: impl Fn(&Pose, u32) -> bool,
) -> Option<WindowAlignment> {
    let ids = recognised(input, aligner, keyframes);
    let seen = candidates_by_features(input, aligner, &ids, MIN_FEATURES as usize);
    let best = seen.into_iter().find(|candidate| is_worth_while(&candidate.guess, candidate.submap))?;
    first_that_fits(input, aligner, vec![best], |_| 0.0).map(|place| place.found)
}

/// Those of these keyframes that show most of the frame's features.
fn recognised(input: &TrackingInput<'_>, aligner: &mut Aligner, keyframes: &[&KeyframeState]) -> Vec<u32> {
    let is_asked = |k: &KeyframeState| keyframes.binary_search_by_key(&k.id, |asked| asked.id).is_ok();
    let n = input.context.mapping.relocalise.n_recognised as usize;
    aligner.sight.recognise_frame(input, [n, LEAST_OF_POSE], is_asked)
}

/// A candidate that passed.
struct FoundPlace {
    found: WindowAlignment,
    how: Cause,
}

/// The first candidate that passes, and how it was found; `prior_nats`: evidence of a place beside the view's.
fn first_that_fits(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    candidates: Vec<Candidate>,
    prior_nats: impl Fn(&WindowAlignment) -> f64,
) -> Option<FoundPlace> {
    for candidate in candidates {
        let guess = place(input, &candidate.guess);
        let there = input.in_submap(candidate.submap);
        let Some((found, fit)) = align_coarse_to_fine(&there, aligner, &guess) else {
            continue;
        };
        // Along a degenerate direction the result is the initial guess: only the last pose is more.
        if !found.alignment.degenerate.is_empty() && !candidate.is_last_pose {
            continue;
        }
        let Some(shown) = found_place::shown(&there, aligner, &found) else { continue };
        // Of the submaps that are joined there, that of the nearest keyframe.
        let submap = found.keyframes(input.map).next().map_or(candidate.submap, |k| k.submap);
        let found = WindowAlignment { submap, ..found };
        let evidence_nats = shown.llr_nats() + prior_nats(&found);
        if matches!(shown, Shown::Evidence(_)) && evidence_nats <= found_place::least_nats(input) {
            continue;
        }
        let how = Cause::Found(candidate.place, fit);
        return Some(FoundPlace { found: WindowAlignment { evidence_nats, ..found }, how });
    }
    None
}

/// Candidates by the last pose and by descriptors, in the order in which they are tried.
fn supposed_candidates(
    input: &TrackingInput<'_>,
    keyframes: &[&KeyframeState],
    prediction: &Prediction,
) -> Vec<Candidate> {
    let is_dropped = input.map.state().is_pose_dropped || is_asked(input);
    let last = (!is_dropped).then(|| last_pose(input, prediction.world_from_camera));
    last.into_iter().chain(similar_keyframes(input, keyframes)).collect()
}

/// Poses of the camera by the features of keyframes, the most inliers first: the keyframes that
/// show most of them, the newest one, and the others in turn.
fn seen_candidates(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    keyframes: &[&KeyframeState],
    turn: usize,
) -> Vec<Candidate> {
    if aligner.sight.n_features() == 0 || !input.context.is_colour_trusted {
        return Vec::new();
    }
    let known = recognised(input, aligner, keyframes);
    let in_turn = keyframes.get(turn % keyframes.len().max(1));
    let mut ids: Vec<u32> =
        known.into_iter().chain([keyframes.last(), in_turn].into_iter().flatten().map(|k| k.id)).collect();
    ids.sort_unstable();
    ids.dedup();
    candidates_by_features(input, aligner, &ids, 0)
}

/// Poses of the camera by the features of these keyframes, the most inliers first.
fn candidates_by_features(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    ids: &[u32],
    min_inliers: usize,
) -> Vec<Candidate> {
    let mut found: Vec<(usize, Candidate)> = Vec::new();
    for &id in ids {
        let Some(keyframe) = input.map.keyframe(id) else { continue };
        let Some(reference) = reference(input, Member::Keyframe(id)) else { continue };
        let pose = reference.world_from_camera;
        let Some(pair) = aligner.sight.pair(input.context, &reference, &pose, Reach::Anywhere) else {
            continue;
        };
        let n = pair.inliers.len();
        if n < min_inliers {
            continue;
        }
        let place = CandidatePlace::Features { n: n as u32, keyframe: id };
        found.push((n, Candidate::at(pose * pair.target_from_query, keyframe.submap, place)));
    }
    found.sort_by_key(|(n, _)| std::cmp::Reverse(*n));
    found.into_iter().map(|(_, candidate)| candidate).collect()
}

/// The pose at which the camera was last, or the start of the run where it was never tracked.
fn last_pose(input: &TrackingInput<'_>, last: Pose) -> Candidate {
    let state = input.map.state();
    let place = if state.is_placed { CandidatePlace::LastPose } else { CandidatePlace::Start };
    // Without a given start the prediction of a run that was never tracked is arbitrary.
    let is_last_pose = state.is_placed || state.start.is_some();
    Candidate { is_last_pose, ..Candidate::at(last, input.map.submap(), place) }
}

/// Keyframes with the most similar descriptors.
fn similar_keyframes(input: &TrackingInput<'_>, keyframes: &[&KeyframeState]) -> Vec<Candidate> {
    let descriptor = input.ferns.code(&input.frame.surface);
    let mut similar: Vec<(f64, u32)> =
        keyframes.iter().map(|k| (similarity(&descriptor, &k.place), k.id)).collect();
    similar.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let candidate = |&(similarity, id): &(f64, u32)| {
        let keyframe = input.map.keyframe(id)?;
        let place = CandidatePlace::Similar { keyframe: id, similarity };
        Some(Candidate::at(Pose::from(&keyframe.world_from_camera), keyframe.submap, place))
    };
    similar
        .iter()
        .take(input.context.mapping.relocalise.n_recognised as usize)
        .filter_map(candidate)
        .collect()
}
