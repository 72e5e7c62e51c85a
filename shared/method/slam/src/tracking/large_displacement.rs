//! The large-displacement hypothesis: a camera that was tracked until now has moved far within one
//! frame, at a low frame rate or by a jerk of the hand.
//!
//! Alignment converges from a tenth of a metre and a few degrees away. Shifts and turns on a coarse
//! grid about the last pose are compared by their support alone, without solving for anything; the
//! best few become initial guesses.

use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::motion_model::place;
use crate::tracking::prediction::Prediction;
use crate::tracking::window_alignment::{every_nth, newest_reference, support};
use tessera_geometry::{Pose, Twist, exp, translation_rotation_norms};

/// Samples that are compared.
const N_SAMPLES: usize = 200;
/// Spacing of the shifts, metres, and their number to each side in x, y and z.
const SPACING_M: f64 = 0.12;
const N_SHIFTS: [i32; 3] = [2, 1, 2];
/// Spacing of the turns, degrees, and their number to each side in pitch and yaw.
const SPACING_DEG: f64 = 5.0;
const N_TURNS: [i32; 2] = [1, 3];
/// Grid poses that become initial guesses.
const N_GUESSES: usize = 4;
/// Largest displacement from one frame to the next, metres and degrees.
const LARGEST_M: f64 = 0.5;
const LARGEST_DEG: f64 = 30.0;

/// The prediction, and the grid poses about the last pose that have most support, with the widest
/// search; none where the settings switch the hypothesis off.
pub(crate) fn guesses(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Vec<Prediction> {
    let Some(last) = last_pose(input).filter(|_| input.context.mapping.window.long_strides) else {
        return Vec::new();
    };
    let mut poses = vec![prediction.world_from_camera];
    poses.extend(supported_poses(input, aligner, &last));
    let guess = |pose| Prediction { previous: prediction.previous, ..place(input, pose) };
    poses.iter().map(guess).collect()
}

/// Whether the camera can have come here from the last pose within one frame.
pub(crate) fn is_within_reach(input: &TrackingInput<'_>, world_from_camera: &Pose) -> bool {
    last_pose(input).is_some_and(|last| {
        let (moved_m, turned_rad) = translation_rotation_norms(&(last.inverse() * world_from_camera));
        moved_m <= LARGEST_M && turned_rad <= LARGEST_DEG.to_radians()
    })
}

fn last_pose(input: &TrackingInput<'_>) -> Option<Pose> {
    input.map.state().recent.last().map(|last| Pose::from(&last.world_from_camera))
}

/// The grid poses about the last pose that have most support, the best first.
fn supported_poses(input: &TrackingInput<'_>, aligner: &mut Aligner, last: &Pose) -> Vec<Pose> {
    let Some(reference) = newest_reference(input, last) else { return Vec::new() };
    let some = every_nth(input.samples, N_SAMPLES);
    let mut scored: Vec<(f64, Cell)> = grid()
        .map(|cell| (support(input, aligner, &some, &reference, &(last * cell.last_from_camera())), cell))
        .collect();
    // Stable: the smallest displacement comes first among equals.
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut best: Vec<Cell> = Vec::with_capacity(N_GUESSES);
    for (_, cell) in scored {
        if best.iter().all(|chosen| !cell.is_beside(chosen)) {
            best.push(cell);
        }
        if best.len() == N_GUESSES {
            break;
        }
    }
    best.iter().map(|cell| last * cell.last_from_camera()).collect()
}

/// One shift and turn of the grid: x, y, z, pitch, yaw.
#[derive(Clone, Copy)]
struct Cell([i32; 5]);

impl Cell {
    fn last_from_camera(self) -> Pose {
        let [x, y, z, pitch, yaw] = self.0.map(f64::from);
        let mut twist = Twist::default();
        (twist.phi.x, twist.phi.y) = (pitch * SPACING_DEG.to_radians(), yaw * SPACING_DEG.to_radians());
        Pose::translation(x * SPACING_M, y * SPACING_M, z * SPACING_M) * exp(&twist)
    }

    /// Whether both lie in the same basin of convergence.
    fn is_beside(&self, other: &Self) -> bool {
        self.0.iter().zip(other.0).all(|(a, b)| (a - b).abs() <= 1)
    }

    fn length_sq(self) -> i32 {
        self.0.iter().map(|n| n * n).sum()
    }
}

/// The smallest first.
fn grid() -> impl Iterator<Item = Cell> {
    let [nx, ny, nz] = N_SHIFTS;
    let [n_pitch, n_yaw] = N_TURNS;
    let mut cells = Vec::new();
    for x in -nx..=nx {
        for y in -ny..=ny {
            for z in -nz..=nz {
                for pitch in -n_pitch..=n_pitch {
                    cells.extend((-n_yaw..=n_yaw).map(|yaw| Cell([x, y, z, pitch, yaw])));
                }
            }
        }
    }
    cells.sort_by_key(|cell| cell.length_sq());
    cells.into_iter()
}
