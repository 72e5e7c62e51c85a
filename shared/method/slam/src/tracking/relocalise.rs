//! Relocalisation: the place in the map of a frame that could not be tracked.
//!
//! Candidates are the last pose, the keyframes whose descriptors are most similar to the frame's,
//! and views turned and shifted against both, a few in each frame. A candidate must pass the strict
//! tests once aligned, and the map changes again only after several frames in a row have passed.

use crate::features::matching::Reach;
use crate::loops::appearance::similarity;
use crate::map::records::State;
use crate::tracking::acceptance;
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::motion_model::{place, widened};
use crate::tracking::prediction::Prediction;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::{
    WindowAlignment, align_coarse_to_fine, align_to, nearby_keyframes, reference,
};
use tessera_geometry::{Pose, Twist, exp};

/// Newest keyframes whose features are matched.
const N_NEWEST: usize = 2;

/// A pose from which an alignment is tried.
struct Candidate {
    guess: Pose,
    /// The view whose neighbours are the references.
    near: Pose,
    name: String,
    is_last_pose: bool,
}

impl Candidate {
    fn at(world_from_camera: Pose, name: String) -> Self {
        Self { guess: world_from_camera, near: world_from_camera, name, is_last_pose: false }
    }
}

/// Tracking after the place was found, under the strict tests, until enough frames in a row have
/// passed them.
pub(crate) fn confirm(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Result<WindowAlignment, String> {
    let settings = &input.context.mapping.relocalise;
    let members = nearby_keyframes(input, &prediction.world_from_camera, usize::MAX);
    let found = align_to(input, aligner, members, input.samples, &widened(input, prediction));
    let numbers = acceptance::strict(settings, &found.alignment)?;
    let n_confirmed = input.map.state().n_confirmed + 1;
    let state = if n_confirmed >= settings.confirm_frames { State::Tracking } else { State::Relocalising };
    let reason = format!("confirmed {n_confirmed} of {} times: {numbers}", settings.confirm_frames);
    Ok(WindowAlignment { state, reason, ..found })
}

/// The first candidate that passes. The error says why the frame was lost, and that none did.
pub(crate) fn relocalise(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
    why_lost: &str,
) -> Result<WindowAlignment, String> {
    if !input.context.mapping.relocalise.enabled {
        return Err(why_lost.into());
    }
    let by_features = seen_candidates(input, aligner);
    let candidates: Vec<Candidate> = by_features.into_iter().chain(candidates(input, prediction)).collect();
    let n_candidates = candidates.len();
    for candidate in candidates {
        let guess = place(input, &candidate.guess);
        let Some((found, numbers)) = align_coarse_to_fine(input, aligner, &guess, &candidate.near) else {
            continue;
        };
        // Along a degenerate direction the result is the initial guess: only the last pose is more.
        if !found.alignment.degenerate.is_empty() && !candidate.is_last_pose {
            continue;
        }
        let reason = format!("{why_lost}; found by {}: {numbers}", candidate.name);
        return Ok(WindowAlignment { state: State::Relocalising, reason, ..found });
    }
    Err(format!("{why_lost}; none of {n_candidates} candidate places fits"))
}

/// All candidates of this frame, in the order in which they are tried.
fn candidates(input: &TrackingInput<'_>, prediction: &Prediction) -> Vec<Candidate> {
    let last = prediction.world_from_camera;
    let similar = similar_keyframes(input);
    let most_similar = similar.first().map(|candidate| candidate.guess);
    let mut candidates = vec![last_pose(input, last)];
    candidates.extend(similar);
    candidates.extend(turned_views_about(input, last, most_similar.unwrap_or(last)));
    candidates
}

/// Where the features of keyframes say that the camera is, the most inliers first: the most similar
/// keyframes, the newest, and others in turn.
fn seen_candidates(input: &TrackingInput<'_>, aligner: &mut Aligner) -> Vec<Candidate> {
    if aligner.sight.n_features() == 0 || !input.context.is_colour_trusted {
        return Vec::new();
    }
    let descriptor = input.ferns.code(&input.frame.surface);
    let active: Vec<_> = input.map.keyframes().filter(|k| k.is_active()).collect();
    let mut similar: Vec<(f64, u32)> =
        active.iter().map(|k| (similarity(&descriptor, &k.place), k.id)).collect();
    similar.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    similar.truncate(input.context.mapping.relocalise.n_recognised as usize);
    let newest = active.iter().rev().take(N_NEWEST).map(|k| k.id);
    let in_turn = active.get(N_NEWEST * input.map.state().n_lost as usize % active.len().max(1));
    let mut ids: Vec<u32> =
        similar.iter().map(|(_, id)| *id).chain(newest).chain(in_turn.map(|k| k.id)).collect();
    ids.sort_unstable();
    ids.dedup();
    let mut found: Vec<(usize, Candidate)> = Vec::new();
    for reference in ids.into_iter().filter_map(|id| reference(input, Member::Keyframe(id))) {
        let pose = reference.world_from_camera;
        let Some(pair) = aligner.sight.pair(input.context, &reference, &pose, Reach::ANYWHERE) else {
            continue;
        };
        let n = pair.inliers.len();
        let name = format!("{n} features of keyframe {}", reference.key.1);
        found.push((n, Candidate::at(pose * pair.target_from_query, name)));
    }
    found.sort_by_key(|(n, _)| std::cmp::Reverse(*n));
    found.into_iter().map(|(_, candidate)| candidate).collect()
}

/// The pose at which the camera was last, or the start of the run where it was never tracked.
fn last_pose(input: &TrackingInput<'_>, last: Pose) -> Candidate {
    let state = input.map.state();
    let name = if state.is_placed { "the last pose" } else { "the start" };
    // Without a given start the prediction of a run that was never tracked is arbitrary.
    let is_last_pose = state.is_placed || state.start.is_some();
    Candidate { is_last_pose, ..Candidate::at(last, name.into()) }
}

/// Keyframes with the most similar descriptors.
fn similar_keyframes(input: &TrackingInput<'_>) -> Vec<Candidate> {
    let descriptor = input.ferns.code(&input.frame.surface);
    let active = input.map.keyframes().filter(|k| k.is_active());
    let mut similar: Vec<(f64, u32)> = active.map(|k| (similarity(&descriptor, &k.place), k.id)).collect();
    similar.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let candidate = |(similarity, id): &(f64, u32)| {
        let pose = Pose::from(&input.map.keyframe(*id)?.world_from_camera);
        Some(Candidate::at(pose, format!("recognising keyframe {id} (similarity {similarity:.2})")))
    };
    similar
        .iter()
        .take(input.context.mapping.relocalise.n_recognised as usize)
        .filter_map(candidate)
        .collect()
}

/// Views about the last pose and about the most similar keyframe in turn, others in each frame.
fn turned_views_about(
    input: &TrackingInput<'_>,
    last: Pose,
    most_similar: Pose,
) -> impl Iterator<Item = Candidate> {
    let views = turned_views();
    let n = input.context.mapping.relocalise.n_turned as usize;
    let round = input.map.state().n_lost as usize;
    let base = if round.is_multiple_of(2) { last } else { most_similar };
    (0..n).map(move |k| {
        let base_from_camera = views[(round / 2 * n + k) % views.len()];
        Candidate { guess: base * base_from_camera, ..Candidate::at(base, "a turned view".into()) }
    })
}

/// Turns about the vertical axis of the camera with shifts along the others.
fn turned_views() -> Vec<Pose> {
    let mut views = Vec::new();
    for shift in [[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]] {
        for yaw_deg in [0.0_f64, 20.0, -20.0, 40.0, -40.0] {
            let mut twist = Twist::default();
            twist.phi.y = yaw_deg.to_radians();
            views.push(Pose::translation(shift[0], 0.0, shift[1]) * exp(&twist));
        }
    }
    views.remove(0);
    views
}
