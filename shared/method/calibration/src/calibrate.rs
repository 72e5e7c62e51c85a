//! The outer loop of calibration: data association, one step of poses and camera at once, the
//! surfaces made again, repeatedly.
//!
//! It is not a `MultiEdge` of `tessera_graph`: the camera borders the system of the poses, each
//! iteration is a single linear step, and its end is judged by what is known of the camera. The
//! limits of data association do not shrink along a schedule either: the poses are optimised.

use crate::directions::Directions;
use crate::jackknife;
use crate::matching;
use crate::parameters::{Parameter, Parameters, of_camera, with_parameters};
use crate::problem::Problem;
use crate::residuals::PairSums;
use crate::sizes;
use crate::solution::{self, Calibration, CalibrationError};
use crate::system::{self, Reduced};
use crate::widths::Widths;
use tessera_geometry::{Camera, Pose, Twist, compose_normalised};

/// Iterations at most.
const MAX_ITERATIONS: u32 = 20;
/// A step below this share of the camera's standard deviation is the end,
const CONVERGED_SHARE: f64 = 0.1;
/// or one below this, pixels.
const CONVERGED_PX: f64 = 0.02;
/// A step is at most this long, pixels: beyond it the linearisation does not hold.
const LARGEST_STEP_PX: f64 = 15.0;
/// Parameters that are solved for from this iteration on, and which.
const FIRST_LATE: u32 = 5;
const LATE: [Parameter; 4] = [Parameter::P1, Parameter::P2, Parameter::K3, Parameter::DepthOffset];
/// Place of [`Parameter::K3`].
const K3: usize = 8;
/// Times that a step may be halved.
const MOST_HALVINGS: u32 = 6;

/// Solves for the camera and all poses at once. The same bits for any number of threads.
///
/// # Errors
/// Too little overlap, or a solution that is not a camera.
pub fn calibrate(problem: &Problem<'_>, progress: &mut dyn FnMut()) -> Result<Calibration, CalibrationError> {
    let start = of_camera(problem.start);
    let mut camera = problem.made_with.clone();
    let mut poses: Vec<Pose> = problem.keyframes.iter().map(|k| k.world_from_camera).collect();
    let velocities: Vec<Twist> = problem.keyframes.iter().map(|k| k.velocity).collect();
    let sizes = sizes::one_pixel(problem.start, &velocities, problem.median_depth_m());
    // What is far from the frames' centre or small waits until the rest is about right.
    let mut waits: Vec<Parameter> = problem.fixed.iter().chain(&LATE).copied().collect();
    let mut first_residual = None;
    let mut n_iterations = 0;
    loop {
        n_iterations += 1;
        let pairs = enough_pairs(problem, matching::match_all(problem, &camera, &poses, n_iterations))?;
        progress();
        let residual = matching::residual_sigmas(&pairs);
        let first = *first_residual.get_or_insert(residual);
        if n_iterations == FIRST_LATE {
            waits = problem.fixed.to_vec();
        }
        let sizes = without(&sizes, &waits);
        let (reduced, directions) = linearise(problem, &pairs, &sizes)?;
        let step = directions.step(&start, &of_camera(&camera));
        let taken = match possible(&camera, step, &sizes) {
            Ok(taken) => taken,
            Err(error) if waits.contains(&Parameter::K3) || n_iterations >= MAX_ITERATIONS => {
                return Err(error);
            }
            // The highest power of a lens bends corners that hardly any surface fills.
            Err(_) => {
                waits.push(Parameter::K3);
                with_first_k3(&camera, &start)?
            }
        };
        camera = taken.camera;
        for (index, pose) in poses.iter_mut().enumerate() {
            *pose = compose_normalised(pose, &reduced.pose_step(index, &taken.step));
        }
        let std_px = solution::std_px(&directions.covariance(), &sizes);
        let is_converged =
            n_iterations > FIRST_LATE && taken.px < (CONVERGED_SHARE * std_px).max(CONVERGED_PX);
        if is_converged || n_iterations >= MAX_ITERATIONS {
            let moved = sizes::in_pixels(&(taken.values - of_camera(problem.made_with)), &sizes).norm();
            return Ok(Calibration {
                estimates: solution::estimates(&directions, (&start, &taken.values)),
                held: solution::held_directions(&directions, &sizes),
                camera,
                world_from_camera: poses,
                residual_sigmas: (first, residual),
                n_iterations,
                is_converged,
                moved_px: moved,
                std_px,
            });
        }
    }
}

/// A camera's step from one iteration to the next.
struct Taken {
    camera: Camera,
    /// The camera's parameters, and the step that led to them.
    values: Parameters,
    step: Parameters,
    px: f64,
}

/// The pairs, where they can determine the poses and the camera.
fn enough_pairs(problem: &Problem<'_>, pairs: Vec<PairSums>) -> Result<Vec<PairSums>, CalibrationError> {
    let expected = problem.keyframes.len().max(3);
    if pairs.len() < expected {
        return Err(CalibrationError::FewPairs { found: pairs.len(), expected });
    }
    Ok(pairs)
}

/// The camera's system once the poses are eliminated, and its directions by how well they are known.
fn linearise(
    problem: &Problem<'_>,
    pairs: &[PairSums],
    sizes: &Parameters,
) -> Result<(Reduced, Directions), CalibrationError> {
    let n_poses = problem.keyframes.len();
    let reduced = system::reduce(pairs, n_poses).ok_or(CalibrationError::Undetermined)?;
    let widths = Widths::new(sizes, problem.start_px);
    let unit = 2.0 * f64::from(problem.noise.sigma_m(1.0)).powi(2);
    let variance = jackknife::gradient_variance(&reduced, pairs, n_poses, &widths, unit)
        .ok_or(CalibrationError::Undetermined)?;
    let directions = Directions::new(&reduced, &variance, widths);
    Ok((reduced, directions))
}

/// A step shortened to where it leads to a camera.
fn possible(camera: &Camera, mut step: Parameters, sizes: &Parameters) -> Result<Taken, CalibrationError> {
    let present = of_camera(camera);
    let mut px = sizes::in_pixels(&step, sizes).norm();
    if px > LARGEST_STEP_PX {
        step *= LARGEST_STEP_PX / px;
        px = LARGEST_STEP_PX;
    }
    let mut tried = with_parameters(camera, &(present + step));
    for _ in 0..MOST_HALVINGS {
        if solution::check(&tried).is_ok() {
            break;
        }
        (step, px) = (0.5 * step, 0.5 * px);
        tried = with_parameters(camera, &(present + step));
    }
    solution::check(&tried)?;
    Ok(Taken { camera: tried, values: present + step, step, px })
}

/// The step that takes the sixth-order distortion back to its start.
fn with_first_k3(camera: &Camera, start: &Parameters) -> Result<Taken, CalibrationError> {
    let present = of_camera(camera);
    let mut step = Parameters::zeros();
    step[K3] = start[K3] - present[K3];
    let camera = with_parameters(camera, &(present + step));
    solution::check(&camera)?;
    Ok(Taken { camera, values: present + step, step, px: LARGEST_STEP_PX })
}

/// The sizes with 0 for parameters that do not take part.
fn without(sizes: &Parameters, fixed: &[Parameter]) -> Parameters {
    let mut sizes = *sizes;
    for (size, parameter) in sizes.iter_mut().zip(&Parameter::ALL) {
        if fixed.contains(parameter) {
            *size = 0.0;
        }
    }
    sizes
}
