//! Tracking from the frame before: the prediction, and the hypotheses tried where it is in doubt
//! (method 6).
//!
//! What fits nowhere about the last pose is left to relocalisation.

use crate::map::cause::Cause;
use crate::tracking::acceptance;
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::motion_model::widened;
use crate::tracking::prediction::Prediction;
use crate::tracking::rotation_hypothesis;
use crate::tracking::start::{FeatureStart, guess_from_features};
use crate::tracking::window_alignment::{WindowAlignment, align_to_window};
use tessera_geometry::{Pose, Twist};

/// Outcome of the alignment from the prediction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Decision {
    /// It passed the strict tests, or needs none.
    Accepted,
    /// It passed the tests of an expected motion, but not the strict ones.
    Doubtful,
    /// It failed, or no motion was known that could be tested.
    Rejected,
}

/// Aligns a frame that follows a tracked one. The error is why the prediction was rejected.
pub(crate) fn track(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Result<WindowAlignment, Cause> {
    let (seen, rival) = match guess_from_features(input, aligner, prediction) {
        Some(FeatureStart::Better(guess)) => (Some(guess), None),
        Some(FeatureStart::Rival(guess)) => (None, Some(guess)),
        Some(FeatureStart::Refused) => {
            aligner.sight.refuse_pairs();
            (None, None)
        }
        None => (None, None),
    };
    let prediction = &seen.unwrap_or(*prediction);
    let guess = if prediction.is_known {
        *prediction
    } else {
        rotation_hypothesis::best_rotation(input, aligner, prediction)
    };
    let mut first = align_to_window(input, aligner, &guess);
    let mut is_seen = seen.is_some();
    if let Some(rival) = rival {
        let second = align_to_window(input, aligner, &rival);
        // Where most points float in what the references saw through, it is not, whatever agrees.
        let is_possible = second.alignment.is_solved && second.alignment.support() > 0.0;
        if is_possible && second.alignment.evidence_nats() > first.alignment.evidence_nats() {
            (first, is_seen) = (second, true);
        }
    }
    let passed =
        acceptance::tracking(&input.context.mapping.window, &first.alignment, prediction.motion.as_ref());
    let is_strict = acceptance::strict(&first.alignment).is_ok();
    let verdict = match (is_strict, prediction.is_known && passed.is_ok()) {
        (true, _) => Decision::Accepted,
        // What features agree on is no guess of the motion.
        (false, true) if is_seen => Decision::Accepted,
        (false, true) => Decision::Doubtful,
        (false, false) => Decision::Rejected,
    };
    let other = match verdict {
        Decision::Accepted => None,
        // A camera that turned faster than predicted may have come to rest in a local minimum.
        Decision::Doubtful => {
            let guess = rotated_prediction(input, aligner, prediction);
            strictly_aligned(input, aligner, &guess)
                .filter(|found| found.alignment.support() > first.alignment.support())
        }
        // Along a degenerate direction the result would be the initial guess, which predicts nothing.
        Decision::Rejected => {
            let guess = rotated_last_pose(input, aligner, prediction);
            strictly_aligned(input, aligner, &guess).filter(|found| found.alignment.degenerate.is_empty())
        }
    };
    if let Some(found) = other {
        return Ok(found);
    }
    if verdict == Decision::Accepted { Ok(first) } else { passed.map(|()| first) }
}

/// The frame aligned from a guess; `None` where it does not pass the strict tests.
fn strictly_aligned(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    guess: &Prediction,
) -> Option<WindowAlignment> {
    let found = align_to_window(input, aligner, guess);
    acceptance::strict(&found.alignment).is_ok().then_some(found)
}

/// The prediction with the rotation that has most support.
fn rotated_prediction(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Prediction {
    let wide = Prediction { is_known: false, ..widened(input, prediction) };
    rotation_hypothesis::best_rotation(input, aligner, &wide)
}

/// The last pose with the rotation that a gyroscope measured, or that has most support.
fn rotated_last_pose(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Prediction {
    let mut guess = widened(input, prediction);
    if let Some(last) = input.map.state().recent.last() {
        guess.world_from_camera = Pose::from(&last.world_from_camera);
        guess.velocity = Twist::default();
        if prediction.rotation_sigma_rad.is_some() {
            guess.world_from_camera.rotation = prediction.world_from_camera.rotation;
        }
    }
    rotation_hypothesis::best_rotation(input, aligner, &guess)
}
