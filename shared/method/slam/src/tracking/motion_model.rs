//! Prediction of a frame's pose: constant velocity, its rotation measured by a gyroscope where the
//! source has one (method 6).

use crate::map::records::State;
use crate::map::state::{MOST_COASTED_S, RecentFrame};
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Prediction;
use nalgebra::Vector3;
use tessera_geometry::{Pose, RelativeRotation, Twist, Vector6, compose_normalised, log};

/// An initial guess that no motion leads to, with the widest search.
pub(crate) fn place(input: &TrackingInput<'_>, world_from_camera: &Pose) -> Prediction {
    let mapping = &input.context.mapping;
    Prediction {
        world_from_camera: *world_from_camera,
        previous: None,
        is_known: false,
        velocity: Twist::default(),
        rotation_sigma_rad: None,
        motion: None,
        first_distance_m: mapping.first_distance_m()[1],
        outer_iterations: mapping.outer_iterations(),
    }
}

/// The same initial guess with the widest search.
pub(crate) fn widened(input: &TrackingInput<'_>, prediction: &Prediction) -> Prediction {
    let mapping = &input.context.mapping;
    Prediction {
        first_distance_m: mapping.first_distance_m()[1],
        outer_iterations: mapping.outer_iterations(),
        ..*prediction
    }
}

/// Constant velocity in the time between the stamps; the last pose where the velocity is unknown.
/// The rotation is the gyroscope's where the source has one.
pub(crate) fn predict(input: &TrackingInput<'_>) -> Prediction {
    let state = input.map.state();
    let Some(last) = state.recent.last() else {
        return place(input, &state.start.as_ref().map_or(Pose::identity(), Pose::from));
    };
    let last_pose = Pose::from(&last.world_from_camera);
    let seconds = input.frame.stamp_nanos.saturating_sub(last.stamp_nanos) as f64 * 1e-9;
    let measured = measured_rotation(input, last, seconds);
    let turn = measured.map(|m| Pose::from_parts(Vector3::zeros().into(), m.earlier_from_later));
    let last_turned = turn.map_or(last_pose, |turn| last_pose * turn);
    // A stamp that does not advance, a gap in time, or a frame that could not be aligned leaves no
    // velocity. A camera that saw nothing for a moment has moved on as before.
    let is_coasting = f64::from(state.n_lost) * seconds < MOST_COASTED_S && last.velocity != [0.0; 6];
    if (last.state == State::Lost && !is_coasting) || !(seconds > 0.0 && seconds < MOST_COASTED_S) {
        return place(input, &last_turned);
    }
    // The second frame of a run: the first has no velocity yet.
    if last.velocity == [0.0; 6] {
        return Prediction { previous: Some((last_pose, seconds)), ..place(input, &last_turned) };
    }
    let motion = state.motion.predict(&last_pose, seconds);
    let mut velocity = Twist::from_vector(&Vector6::from_column_slice(&last.velocity));
    if let Some(motion) = &motion {
        velocity = log(&(last_pose.inverse() * motion.world_from_camera)).scaled(1.0 / seconds);
    }
    if let Some(measured) = &measured {
        velocity.phi = measured.rate_rad_per_s(seconds);
    }
    let world_from_camera = compose_normalised(&last_pose, &velocity.scaled(seconds));
    let motion = motion.map(|motion| match &measured {
        Some(measured) => motion.turned(&world_from_camera, measured.sigma_rad),
        None => motion,
    });
    // Three deviations, of points a metre away.
    let first_m =
        motion.as_ref().map_or(f64::INFINITY, |motion| 3.0 * motion.variance.iter().sum::<f64>().sqrt());
    let mapping = &input.context.mapping;
    let [least_m, most_m] = mapping.first_distance_m();
    Prediction {
        world_from_camera,
        previous: Some((last_pose, seconds)),
        is_known: true,
        velocity,
        rotation_sigma_rad: measured.map(|m| m.sigma_rad),
        motion,
        first_distance_m: first_m.clamp(least_m, most_m),
        outer_iterations: mapping.outer_iterations(),
    }
}

/// The gyroscope's rotation since the last frame, where the source has one.
fn measured_rotation(
    input: &TrackingInput<'_>,
    last: &RecentFrame,
    seconds: f64,
) -> Option<RelativeRotation> {
    let (earlier, later) = (last.rotation?, input.frame.rotation?);
    (seconds > 0.0).then(|| earlier.until(&later, seconds))
}
