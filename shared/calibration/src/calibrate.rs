//! The outer loop: match, solve for poses and camera at once, re-make the surfaces, again.

use crate::directions::Directions;
use crate::jackknife;
use crate::matching;
use crate::parameters::{Parameter, Parameters, of_camera, with_parameters};
use crate::problem::Problem;
use crate::sizes;
use crate::solution::{self, Calibration, CalibrationError};
use crate::system;
use crate::widths::Widths;
use tessera_geometry::{Pose, Twist, compose_normalised};

/// Iterations at most.
const MAX_ITERATIONS: u32 = 20;
/// A step below this share of the camera's standard deviation is the end,
const CONVERGED_SHARE: f64 = 0.1;
/// or one below this, pixels.
const CONVERGED_PX: f64 = 0.02;
/// A step is at most this long, pixels: beyond it the linearisation says little.
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
/// Too little overlap, or a solution that is no camera.
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
        let pairs = matching::match_all(problem, &camera, &poses, n_iterations);
        progress();
        if pairs.len() < problem.keyframes.len() || pairs.len() < 3 {
            return Err(CalibrationError::FewPairs {
                found: pairs.len(),
                expected: problem.keyframes.len().max(3),
            });
        }
        let residual = matching::residual_sigmas(&pairs);
        let first = *first_residual.get_or_insert(residual);
        if n_iterations == FIRST_LATE {
            waits = problem.fixed.to_vec();
        }
        let sizes = without(&sizes, &waits);
        let reduced = system::reduce(&pairs, poses.len()).ok_or(CalibrationError::Undetermined)?;
        let widths = Widths::new(&sizes, problem.start_px);
        let unit = 2.0 * f64::from(problem.noise.sigma_m(1.0)).powi(2);
        let variance = jackknife::gradient_variance(&reduced, &pairs, poses.len(), &widths, unit)
            .ok_or(CalibrationError::Undetermined)?;
        let directions = Directions::new(&reduced, &variance, widths);
        let present = of_camera(&camera);
        let mut step = directions.step(&start, &present);
        let mut step_px = sizes::in_pixels(&step, &sizes).norm();
        if step_px > LARGEST_STEP_PX {
            step *= LARGEST_STEP_PX / step_px;
            step_px = LARGEST_STEP_PX;
        }
        // A step that leads beyond what can be a camera is taken in part.
        let mut tried = with_parameters(&camera, &(present + step));
        for _ in 0..MOST_HALVINGS {
            if solution::check(&tried).is_ok() {
                break;
            }
            (step, step_px) = (0.5 * step, 0.5 * step_px);
            tried = with_parameters(&camera, &(present + step));
        }
        if let Err(error) = solution::check(&tried) {
            // The highest power of a lens bends corners that hardly any surface fills.
            if waits.contains(&Parameter::K3) || n_iterations >= MAX_ITERATIONS {
                return Err(error);
            }
            waits.push(Parameter::K3);
            step = Parameters::zeros();
            step[K3] = start[K3] - present[K3];
            step_px = LARGEST_STEP_PX;
            tried = with_parameters(&camera, &(present + step));
            solution::check(&tried)?;
        }
        let values = present + step;
        camera = tried;
        for (index, pose) in poses.iter_mut().enumerate() {
            *pose = compose_normalised(pose, &reduced.pose_step(index, &step));
        }
        let std_px = solution::std_px(&directions.covariance(), &sizes);
        let is_converged =
            n_iterations > FIRST_LATE && step_px < (CONVERGED_SHARE * std_px).max(CONVERGED_PX);
        if is_converged || n_iterations >= MAX_ITERATIONS {
            let moved = sizes::in_pixels(&(values - of_camera(problem.made_with)), &sizes).norm();
            return Ok(Calibration {
                estimates: solution::estimates(&directions, (&start, &values)),
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
