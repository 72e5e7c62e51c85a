//! Tracking from the frame before: the prediction, and the hypotheses tried where it is in doubt
//! (method 6).
//!
//! A hypothesis is an entry of [`HYPOTHESES`]: when it is tried, its initial guesses with their
//! search settings, how a guess is aligned, and what a result must show beside the strict tests.
//! One loop walks the table; of a hypothesis's guesses the best supported one counts.

use crate::tracking::acceptance::{self, STRICT};
use crate::tracking::alignment::{Aligner, Alignment};
use crate::tracking::input::TrackingInput;
use crate::tracking::motion_model::{place, widened};
use crate::tracking::prediction::Prediction;
use crate::tracking::start::{FeatureStart, OUTER_ITERATIONS, guess_from_features};
use crate::tracking::window_alignment::{WindowAlignment, align_coarse_to_fine, align_to_window};
use crate::tracking::{large_displacement, rotation_hypothesis};
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

/// How a guess is aligned.
#[derive(Clone, Copy, Debug)]
enum Search {
    /// All samples to the local window.
    Window,
    /// Some samples to the nearest keyframes, then all.
    CoarseToFine,
}

/// What a result must show beside the strict tests.
#[derive(Clone, Copy, Debug)]
enum Acceptance {
    /// More inliers, less free-space violations, than the alignment from the prediction has.
    MoreSupport,
    /// No degenerate direction: along one the result is the initial guess, which predicts nothing.
    WellConditioned,
    /// As [`Self::WellConditioned`], within a large displacement of the last pose.
    WithinReach,
}

/// One way in which a frame may have moved.
struct Hypothesis {
    after: Decision,
    /// Initial guesses and their search settings.
    guesses: fn(&TrackingInput<'_>, &mut Aligner, &Prediction) -> Vec<Prediction>,
    search: Search,
    acceptance: Acceptance,
    /// Name in the frame's reason, for a motion that a user may want to know of.
    name: Option<&'static str>,
}

/// In the order in which they are tried; the first that is accepted counts.
const HYPOTHESES: [Hypothesis; 4] = [
    // A camera that turned faster than predicted may have come to rest in a local minimum.
    Hypothesis {
        after: Decision::Doubtful,
        guesses: rotated_prediction,
        search: Search::Window,
        acceptance: Acceptance::MoreSupport,
        name: None,
    },
    Hypothesis {
        after: Decision::Rejected,
        guesses: rotated_last_pose,
        search: Search::Window,
        acceptance: Acceptance::WellConditioned,
        name: None,
    },
    Hypothesis {
        after: Decision::Rejected,
        guesses: last_keyframe,
        search: Search::Window,
        acceptance: Acceptance::WellConditioned,
        name: None,
    },
    Hypothesis {
        after: Decision::Rejected,
        guesses: large_displacement::guesses,
        search: Search::CoarseToFine,
        acceptance: Acceptance::WithinReach,
        name: Some("a large displacement"),
    },
];

/// Aligns a frame that follows a tracked one. The error says why the prediction was rejected.
pub(crate) fn track(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Result<WindowAlignment, String> {
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
        outer_iterations: OUTER_ITERATIONS,
        ..*prediction
    };
    let again = align_to_window(input, aligner, &guess);
    match acceptance::tracking(window, &again.alignment) {
        Ok(()) => WindowAlignment { reason: found.reason, ..again },
        Err(_) => found,
    }
}

fn track_from(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Result<WindowAlignment, String> {
    let (seen, rival) = match guess_from_features(input, aligner, prediction) {
        Some(FeatureStart::Better(guess)) => (Some(guess), None),
        Some(FeatureStart::Rival(guess)) => {
            (None, Some(guess).filter(|_| !input.context.is_colour_on_probation))
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
    let is_strict = acceptance::strict(&STRICT, &first.alignment).is_ok();
    let verdict = match (is_strict, prediction.is_known && passed.is_ok()) {
        (true, _) => Decision::Accepted,
        // What features agree on is no guess of the motion.
        (false, true) if is_seen => Decision::Accepted,
        (false, true) => Decision::Doubtful,
        (false, false) => Decision::Rejected,
    };
    for hypothesis in HYPOTHESES.iter().filter(|h| h.after == verdict) {
        let Some((found, numbers)) = hypothesis.test(input, aligner, prediction, &first) else { continue };
        let reason = hypothesis.name.map_or(String::new(), |name| {
            let why = passed.as_ref().err().map_or("the motion is not known", String::as_str);
            format!("{why}; found by {name}: {numbers}")
        });
        return Ok(WindowAlignment { reason, ..found });
    }
    if verdict == Decision::Accepted { Ok(first) } else { passed.map(|()| first) }
}

impl Hypothesis {
    /// The best supported of the accepted results, with the numbers of the strict tests.
    fn test(
        &self,
        input: &TrackingInput<'_>,
        aligner: &mut Aligner,
        prediction: &Prediction,
        first: &WindowAlignment,
    ) -> Option<(WindowAlignment, String)> {
        let mut best: Option<(WindowAlignment, String)> = None;
        for guess in (self.guesses)(input, aligner, prediction) {
            let Some((found, numbers)) = self.search.align(input, aligner, &guess) else { continue };
            let most = best.as_ref().map_or(f64::NEG_INFINITY, |(best, _)| best.alignment.support());
            if found.alignment.support() > most
                && self.acceptance.is_met(input, &found.alignment, &first.alignment)
            {
                best = Some((found, numbers));
            }
        }
        best
    }
}

impl Search {
    /// An alignment that passes the strict tests, with the numbers of these.
    fn align(
        self,
        input: &TrackingInput<'_>,
        aligner: &mut Aligner,
        guess: &Prediction,
    ) -> Option<(WindowAlignment, String)> {
        match self {
            Self::Window => {
                let found = align_to_window(input, aligner, guess);
                acceptance::strict(&STRICT, &found.alignment).ok().map(|numbers| (found, numbers))
            }
            Self::CoarseToFine => align_coarse_to_fine(input, aligner, guess, &guess.world_from_camera),
        }
    }
}

impl Acceptance {
    fn is_met(self, input: &TrackingInput<'_>, found: &Alignment, first: &Alignment) -> bool {
        match self {
            Self::MoreSupport => found.support() > first.support(),
            Self::WellConditioned => found.degenerate.is_empty(),
            Self::WithinReach => {
                found.degenerate.is_empty()
                    && found.support() > 0.0
                    && large_displacement::is_within_reach(input, &found.world_from_camera)
            }
        }
    }
}

/// The prediction with the rotation that has most support.
fn rotated_prediction(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Vec<Prediction> {
    let wide = Prediction { is_known: false, ..widened(input, prediction) };
    vec![rotation_hypothesis::best_rotation(input, aligner, &wide)]
}

/// The last pose with the rotation that a gyroscope measured, or that has most support.
fn rotated_last_pose(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Vec<Prediction> {
    let mut guess = widened(input, prediction);
    if let Some(last) = input.map.state().recent.last() {
        guess.world_from_camera = Pose::from(&last.world_from_camera);
        guess.velocity = Twist::default();
        if prediction.rotation_sigma_rad.is_some() {
            guess.world_from_camera.rotation = prediction.world_from_camera.rotation;
        }
    }
    vec![rotation_hypothesis::best_rotation(input, aligner, &guess)]
}

/// The pose of the last keyframe that this run made.
fn last_keyframe(input: &TrackingInput<'_>, _: &mut Aligner, _: &Prediction) -> Vec<Prediction> {
    let keyframe = input.map.last_own_keyframe();
    keyframe.map(|k| place(input, &Pose::from(&k.world_from_camera))).into_iter().collect()
}
