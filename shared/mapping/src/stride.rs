//! A camera that was tracked until now and has made a long stride: few frames a second, or a hand
//! that jerked.
//!
//! Alignment follows a shift of a tenth of a metre and a turn of a few degrees. Shifts and turns on a
//! coarse grid about the last pose are compared by how many points of the frame they bring onto the
//! newest reference, without solving for anything; the best few are worth an alignment.

use crate::alignment::{Prediction, Reference};
use crate::attempt::Attempt;
use crate::relocalise::coarse;
use crate::tracker::{Surfaces, Tracker};
use crate::window;
use tessera_geometry::{Pose, Twist, exp, translation_rotation_norms};
use tessera_registration::Sample;

/// Samples that are compared.
const N_SAMPLES: usize = 200;
/// Metres between the shifts of the grid; how many there are to each side, in x, y and z.
const SPACING_M: f64 = 0.12;
const N_SHIFTS: [i32; 3] = [2, 1, 2];
/// Degrees between the turns of the grid; how many there are to each side, in pitch and yaw.
const SPACING_DEG: f64 = 5.0;
const N_TURNS: [i32; 2] = [1, 3];
/// Starts that are worth an alignment.
const N_STARTS: usize = 4;
/// Farthest that a camera comes from one frame to the next, metres and degrees.
const LONGEST_M: f64 = 0.5;
const LONGEST_DEG: f64 = 30.0;

impl Tracker {
    /// Where the frame lies within a long stride of the last one, under the strict tests: of the
    /// prediction and the starts that fit best, the one that ends with the most points on its
    /// references. None where a direction is free (there a start decides), and where the settings say so.
    pub(crate) fn long_stride(
        &mut self,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
    ) -> Option<(Attempt, String)> {
        let last = self.state.recent.last().filter(|_| self.context.mapping.window.long_strides)?;
        let last = Pose::from(&last.world_from_camera);
        let mut starts = vec![prediction.world_from_camera];
        starts.extend(self.starts(&last, samples, surfaces));
        let coarse = coarse(samples);
        let mut best: Option<(Attempt, String)> = None;
        for start in starts {
            let start = Prediction { previous: prediction.previous, ..self.wide(&start) };
            let near = start.world_from_camera;
            let Some((attempt, numbers)) = self.settle(&start, &near, [&coarse, samples], surfaces) else {
                continue;
            };
            let found = &attempt.alignment;
            let most = best.as_ref().map_or(0.0, |(attempt, _)| attempt.alignment.fitting());
            if found.free.is_empty() && is_stride(&last, &found.world_from_camera) && found.fitting() > most {
                best = Some((attempt, numbers));
            }
        }
        best
    }

    /// The starts about the last pose that fit best, the best first.
    fn starts(&mut self, last: &Pose, samples: &[Sample], surfaces: &Surfaces<'_>) -> Vec<Pose> {
        let members = window::select(&self.state, &self.context.mapping.window, last, 0);
        let Some(reference) = members.into_iter().find_map(|m| self.reference(m, surfaces)) else {
            return Vec::new();
        };
        let step = samples.len().div_ceil(N_SAMPLES).max(1);
        let some: Vec<Sample> = samples.iter().step_by(step).copied().collect();
        let mut scored: Vec<(f64, Cell)> =
            grid().map(|cell| (self.fitting(&some, &reference, &(last * cell.delta())), cell)).collect();
        // Stable: the smallest stride comes first among equals.
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut best: Vec<Cell> = Vec::with_capacity(N_STARTS);
        for (_, cell) in scored {
            if best.iter().all(|chosen| !cell.is_beside(chosen)) {
                best.push(cell);
            }
            if best.len() == N_STARTS {
                break;
            }
        }
        best.iter().map(|cell| last * cell.delta()).collect()
    }

    /// Points that come to lie on the reference, less those that come to lie in front of it.
    pub(crate) fn fitting(&mut self, samples: &[Sample], reference: &Reference<'_>, pose: &Pose) -> f64 {
        let report = self.aligner.try_pose(&self.context, samples, reference, pose);
        f64::from(report.n_matches) - f64::from(report.n_in_front)
    }
}

/// Whether a camera can have come from one pose to the other in one frame.
fn is_stride(last: &Pose, world_from_camera: &Pose) -> bool {
    let (moved_m, turned_rad) = translation_rotation_norms(&(last.inverse() * world_from_camera));
    moved_m <= LONGEST_M && turned_rad <= LONGEST_DEG.to_radians()
}

/// One shift and turn of the grid: x, y, z, pitch, yaw.
#[derive(Clone, Copy)]
struct Cell([i32; 5]);

impl Cell {
    /// `last_from_camera`.
    fn delta(self) -> Pose {
        let [x, y, z, pitch, yaw] = self.0.map(f64::from);
        let mut twist = Twist::default();
        (twist.phi.x, twist.phi.y) = (pitch * SPACING_DEG.to_radians(), yaw * SPACING_DEG.to_radians());
        Pose::translation(x * SPACING_M, y * SPACING_M, z * SPACING_M) * exp(&twist)
    }

    /// An alignment from one leads to the other's result.
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
