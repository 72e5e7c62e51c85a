//! A first turn for a frame whose motion is not known: the start of a run, a jump, a gap.
//!
//! Alignment follows a turn of a few degrees and no more. Turns on a coarse grid are compared by
//! how many points of the frame they bring onto the reference, without solving for anything.

use crate::alignment::Prediction;
use crate::tracker::{Surfaces, Tracker};
use crate::window;
use tessera_geometry::{Pose, Twist, exp};
use tessera_registration::Sample;

/// Samples that are compared.
const N_SAMPLES: usize = 500;
/// Degrees between the turns of the grid, and how many there are to each side.
const SPACING_DEG: f64 = 3.0;
const N_YAW: i32 = 4;
const N_PITCH: i32 = 2;
/// A turn must bring this many times the points of no turn onto the reference, or it is not taken.
const LEAST_GAIN: f64 = 1.2;

impl Tracker {
    /// The prediction turned to where the frame fits its newest reference best; as it is where a
    /// gyroscope measured the turn.
    pub(crate) fn turned(
        &mut self,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
    ) -> Prediction {
        if prediction.rotation_sigma_rad.is_some() {
            return *prediction;
        }
        let settings = self.context.mapping.window.clone();
        let members = window::select(&self.state, &settings, &prediction.world_from_camera, 0);
        let Some(reference) = members.into_iter().find_map(|m| self.reference(m, surfaces)) else {
            return *prediction;
        };
        let step = samples.len().div_ceil(N_SAMPLES).max(1);
        let some: Vec<Sample> = samples.iter().step_by(step).copied().collect();
        let start = prediction.world_from_camera;
        let none = self.fitting(&some, &reference, &start);
        let mut best = (LEAST_GAIN * none, start);
        for turn in turns() {
            let pose = start * turn;
            let fitting = self.fitting(&some, &reference, &pose);
            if fitting > best.0 {
                best = (fitting, pose);
            }
        }
        Prediction { world_from_camera: best.1, ..*prediction }
    }
}

/// All turns of the grid but none, the smallest first.
fn turns() -> impl Iterator<Item = Pose> {
    let mut grid: Vec<(i32, i32)> = (-N_YAW..=N_YAW)
        .flat_map(|yaw| (-N_PITCH..=N_PITCH).map(move |pitch| (yaw, pitch)))
        .filter(|turn| *turn != (0, 0))
        .collect();
    grid.sort_by_key(|(yaw, pitch)| yaw * yaw + pitch * pitch);
    grid.into_iter().map(|(yaw, pitch)| {
        let mut twist = Twist::default();
        twist.phi.y = f64::from(yaw) * SPACING_DEG.to_radians();
        twist.phi.x = f64::from(pitch) * SPACING_DEG.to_radians();
        exp(&twist)
    })
}
