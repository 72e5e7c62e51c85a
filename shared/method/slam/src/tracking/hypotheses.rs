//! Tracking from the frame before: the prediction, and the hypotheses tried where it is in doubt
//! (method 6).
//!
//! A hypothesis is an entry of [`HYPOTHESES`]: when it is tried, its initial guess with its search settings, and
//! what a result must show beside the strict tests. One loop walks the table. What fits nowhere about the last pose is
//! left to relocalisation.

use crate::map::cause::Cause;
use crate::settings::WindowSettings;
use crate::tracking::acceptance;
use crate::tracking::alignment::{Aligner, Alignment};
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

/// Condition on a result beside the strict tests.
#[derive(Clone, Copy, Debug)]
enum Acceptance {
    /// More inliers, less free-space violations, than the alignment from the prediction has.
    MoreSupport,
    /// No degenerate direction: along one the result is the initial guess, which predicts nothing.
    WellConditioned,
}

/// One way in which a frame may have moved.
struct Hypothesis {
    after: Decision,
    /// Initial guess and its search settings.
    guess: fn(&TrackingInput<'_>, &mut Aligner, &Prediction) -> Prediction,
    acceptance: Acceptance,
}

/// In the order in which they are tried; the first that is accepted counts.
const HYPOTHESES: [Hypothesis; 2] = [
    // A camera that turned faster than predicted may have come to rest in a local minimum.
    Hypothesis { after: Decision::Doubtful, guess: rotated_prediction, acceptance: Acceptance::MoreSupport },
    Hypothesis {
        after: Decision::Rejected,
        guess: rotated_last_pose,
        acceptance: Acceptance::WellConditioned,
    },
];

/// Aligns a frame that follows a tracked one. The error is why the prediction was rejected.
pub(crate) fn track(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Result<WindowAlignment, Cause> {
    if input.context.is_colour_on_probation {
        let context = &input.context.without_guesses();
        let found = track_from(&TrackingInput { context, ..*input }, aligner, prediction);
        // Where surfaces leave a direction open, what is not known to be wrong is better than nothing.
        if let Ok(found) = found
            && found.alignment.degenerate.is_empty()
        {
            return Ok(once_more(input, aligner, prediction, found));
        }
    }
    track_from(input, aligner, prediction)
}

/// Aligns a frame again from where it was found: its features have their full weight there.
fn once_more(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
    found: WindowAlignment,
) -> WindowAlignment {
    let window = &input.context.mapping.window;
    let guess = Prediction {
        world_from_camera: found.alignment.world_from_camera,
        is_known: true,
        first_distance_m: window.min_first_distance_m,
        outer_iterations: WindowSettings::REFINING_ITERATIONS,
        ..*prediction
    };
    let again = align_to_window(input, aligner, &guess);
    match acceptance::tracking(window, &again.alignment) {
        Ok(()) => again,
        Err(_) => found,
    }
}

fn track_from(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Result<WindowAlignment, Cause> {
    let (seen, rival) = match guess_from_features(input, aligner, prediction) {
        Some(FeatureStart::Better(guess)) => (Some(guess), None),
        Some(FeatureStart::Rival(guess)) => {
            (None, Some(guess).filter(|_| !input.context.is_colour_on_probation))
        }
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
    let passed = acceptance::tracking(&input.context.mapping.window, &first.alignment);
    let is_strict = acceptance::strict(&first.alignment).is_ok();
    let verdict = match (is_strict, prediction.is_known && passed.is_ok()) {
        (true, _) => Decision::Accepted,
        // What features agree on is no guess of the motion.
        (false, true) if is_seen => Decision::Accepted,
        (false, true) => Decision::Doubtful,
        (false, false) => Decision::Rejected,
    };
    for hypothesis in HYPOTHESES.iter().filter(|h| h.after == verdict) {
        if let Some(found) = hypothesis.test(input, aligner, prediction, &first) {
            return Ok(found);
        }
    }
    if verdict == Decision::Accepted { Ok(first) } else { passed.map(|()| first) }
}

impl Hypothesis {
    /// The result, where it is accepted.
    fn test(
        &self,
        input: &TrackingInput<'_>,
        aligner: &mut Aligner,
        prediction: &Prediction,
        first: &WindowAlignment,
    ) -> Option<WindowAlignment> {
        let guess = (self.guess)(input, aligner, prediction);
        let found = align_to_window(input, aligner, &guess);
        let is_good = acceptance::strict(&found.alignment).is_ok()
            && self.acceptance.is_met(&found.alignment, &first.alignment);
        is_good.then_some(found)
    }
}

impl Acceptance {
    fn is_met(self, found: &Alignment, first: &Alignment) -> bool {
        match self {
            Self::MoreSupport => found.support() > first.support(),
            Self::WellConditioned => found.degenerate.is_empty(),
        }
    }
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
