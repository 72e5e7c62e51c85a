//! The rotation hypothesis: an initial guess for a frame whose rotation is not known, as at the
//! start of a run, after a gap, or in a fast turn.
//!
//! Alignment converges from a few degrees away and no more. Rotations on a coarse grid are compared
//! by their support alone, without solving for anything.

use crate::tracking::alignment::{Aligner, SURFACE_CORRELATION};
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Prediction;
use crate::tracking::window_alignment::{COARSE_SAMPLES, every_nth, newest_reference, support};
use tessera_geometry::{Pose, Twist, exp};

/// Spacing of the grid, degrees, and the number of rotations to each side; up and down by the shape of the image.
const SPACING_DEG: f64 = 3.0;
const N_YAW: i32 = 4;

/// The guess with the rotation that has most support against its newest reference; unchanged where
/// a gyroscope measured the rotation.
pub(crate) fn best_rotation(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    guess: &Prediction,
) -> Prediction {
    if guess.rotation_sigma_rad.is_some() {
        return *guess;
    }
    let start = guess.world_from_camera;
    let Some(reference) = newest_reference(input, &start) else { return *guess };
    let some = every_nth(input.samples, COARSE_SAMPLES);
    // Evidence for a rotation must exceed that any of the grid has it by chance.
    let chance = SURFACE_CORRELATION * libm::log(rotations(input).count() as f64);
    let mut best = (support(input, aligner, &some, &reference, &start) + chance, start);
    for rotation in rotations(input) {
        let pose = start * rotation;
        let found = support(input, aligner, &some, &reference, &pose);
        if found > best.0 {
            best = (found, pose);
        }
    }
    Prediction { world_from_camera: best.1, ..*guess }
}

/// All rotations of the grid but identity, the smallest first.
fn rotations(input: &TrackingInput<'_>) -> impl Iterator<Item = Pose> + use<> {
    let n_pitch = N_YAW * input.context.grid.height as i32 / input.context.grid.width.max(1) as i32;
    let mut grid: Vec<(i32, i32)> = (-N_YAW..=N_YAW)
        .flat_map(|yaw| (-n_pitch..=n_pitch).map(move |pitch| (yaw, pitch)))
        .filter(|rotation| *rotation != (0, 0))
        .collect();
    grid.sort_by_key(|(yaw, pitch)| yaw * yaw + pitch * pitch);
    grid.into_iter().map(|(yaw, pitch)| {
        let mut twist = Twist::default();
        twist.phi.y = f64::from(yaw) * SPACING_DEG.to_radians();
        twist.phi.x = f64::from(pitch) * SPACING_DEG.to_radians();
        exp(&twist)
    })
}
