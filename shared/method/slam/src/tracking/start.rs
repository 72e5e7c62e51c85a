//! The pose on which features agree, as an initial guess in place of the motion prediction.

use crate::evidence::pose_agreement::{CHI_SQUARE_6, FAR_VOLUME};
use crate::pairs::keyframe_pair::MIN_FEATURES;
use crate::pairs::matching::Reach;
use crate::settings::WindowSettings;
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Prediction;
use crate::tracking::window::{self, Member};
use crate::tracking::window_alignment::{COARSE_SAMPLES, every_nth, newest_reference, reference, support};
use tessera_geometry::{Pose, log};

/// Members of the window that are asked near where they are predicted.
const ASKED_IF_PREDICTED: usize = 2;
/// Evidence that an image is of its time, nats, without which it is not followed: odds of twenty to one.
const IMAGE_NATS: f64 = 3.0;
/// Share of the prediction's support that the features' guess must have.
const LEAST_SUPPORT: f64 = 0.9;

/// A frame's pose by its features, as an initial guess.
pub(crate) enum FeatureStart {
    /// Here the alignment starts.
    Better(Prediction),
    /// Surfaces support a known motion more, but the two are different places: both are tried.
    Rival(Prediction),
    /// Neither a motion leads there nor do surfaces tell it: the image is of another time.
    Refused,
}

/// The prediction at the pose that features agree on; `None` without one, or where that is the predicted one and the
/// surfaces support it less.
pub(crate) fn guess_from_features(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Option<FeatureStart> {
    let world_from_camera = pose_from_features(input, aligner, &prediction.world_from_camera)?;
    let newest = newest_reference(input, &prediction.world_from_camera)?;
    let some = every_nth(input.samples, COARSE_SAMPLES);
    let predicted = support(input, aligner, &some, &newest, &prediction.world_from_camera);
    let seen = support(input, aligner, &some, &newest, &world_from_camera);
    let is_better = !prediction.is_known || seen >= LEAST_SUPPORT * predicted;
    let motion_nats = prediction.motion.as_ref().map(|m| m.coincidence_nats(&world_from_camera, FAR_VOLUME));
    let image_nats = input.map.state().colour.image_nats();
    if !is_better && motion_nats.is_some_and(|nats| nats + image_nats < IMAGE_NATS) {
        return Some(FeatureStart::Refused);
    }
    let is_elsewhere =
        || prediction.motion.as_ref().is_some_and(|m| m.squared_distance(&world_from_camera) > CHI_SQUARE_6);
    if !is_better && !is_elsewhere() {
        return None;
    }
    let mut guess = Prediction {
        world_from_camera,
        is_known: true,
        first_distance_m: input.context.mapping.first_distance_m()[0],
        outer_iterations: WindowSettings::REFINING_ITERATIONS,
        ..*prediction
    };
    if let Some((previous, seconds)) = prediction.previous {
        guess.velocity = log(&(previous.inverse() * world_from_camera)).scaled(1.0 / seconds);
        aligner.sight.observe_again(input.context, &input.frame.surface, &guess.velocity);
    }
    Some(if is_better { FeatureStart::Better(guess) } else { FeatureStart::Rival(guess) })
}

/// The pose with most inliers against the newest members of the window: near where they are
/// predicted, and anywhere where too few are there.
fn pose_from_features(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    world_from_camera: &Pose,
) -> Option<Pose> {
    let is_wanted = input.context.mapping.features.gives_guess && input.context.is_colour_trusted;
    if aligner.sight.n_features() == 0 || !is_wanted {
        return None;
    }
    let mut members = window::select(&input.map, &input.context.mapping.window, world_from_camera);
    let last = input.map.last_own_keyframe().map(|k| Member::Keyframe(k.id));
    members.extend(last.filter(|last| !members.contains(last)));
    for (reach, most) in [(Reach::Near, ASKED_IF_PREDICTED), (Reach::Anywhere, members.len())] {
        let mut best: Option<(usize, Pose)> = None;
        for reference in members.iter().take(most).filter_map(|member| reference(input, *member)) {
            let found = aligner.sight.pair(input.context, &reference, world_from_camera, reach);
            let Some(pair) = found else { continue };
            let n = pair.inliers.len();
            if best.as_ref().is_none_or(|best| n > best.0) {
                best = Some((n, reference.world_from_camera * pair.target_from_query));
            }
            if n >= MIN_FEATURES as usize {
                break;
            }
        }
        if let Some((_, pose)) = best {
            return Some(pose);
        }
    }
    None
}
