//! The outer loop: match, solve for poses and camera at once, re-make the surfaces, again.

use crate::directions::{self, Direction};
use crate::parameters::{Parameter, Parameters, of_camera, with_parameters};
use crate::residuals::{self, PairSums, Rule, Sides};
use crate::sizes;
use crate::system::{self, Reduced};
use crate::warp::SurfaceWarp;
use rayon::prelude::*;
use tessera_geometry::{Camera, CameraError, DepthNoise, Pose, Twist, compose_normalised};
use tessera_registration::{
    GridCamera, MatchLimits, Matcher, Queries, RegistrationSettings, Sampler, Selection, ShutterTable, Target,
};
use tessera_surface::{Grid, SurfaceView, Vertex};

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
/// Fewer matches do not make a pair.
const MIN_MATCHES: usize = 30;

/// A keyframe with its surface as `made_with` saw it.
#[derive(Clone, Copy, Debug)]
pub struct Keyframe<'a> {
    /// Frame index: the seed of its samples.
    pub frame_index: u64,
    /// Pose at the frame's stamp.
    pub world_from_camera: Pose,
    /// Motion per second in the camera's frame.
    pub velocity: Twist,
    /// Vertices, row by row.
    pub vertices: &'a [Vertex],
}

/// What is to be solved.
#[derive(Clone, Debug)]
pub struct Problem<'a> {
    /// The camera with which the surfaces and poses were made: where the iteration begins.
    pub made_with: &'a Camera,
    /// The camera whose values are kept where the motion determines nothing.
    pub start: &'a Camera,
    /// Shape of all surfaces.
    pub grid: Grid,
    /// Where the measurement of a cell lies relative to the cell's first pixel.
    pub offset_px: f64,
    /// Noise of the depth.
    pub noise: DepthNoise,
    /// Sampling, search and weights.
    pub registration: &'a RegistrationSettings,
    /// Keyframes; the first one's pose is fixed.
    pub keyframes: &'a [Keyframe<'a>],
    /// Pairs `(query, target)` of keyframes that see the same.
    pub pairs: &'a [(usize, usize)],
    /// Queries of a pair.
    pub queries_per_pair: usize,
    /// Largest distance of a match in the first iteration, metres.
    pub first_distance_m: f64,
    /// Least share of queries with a match for a pair to count.
    pub min_overlap: f64,
    /// A combination of parameters whose standard deviation exceeds this many pixels is held.
    pub hold_px: f64,
    /// Parameters that keep their start whatever the motion.
    pub fixed: &'a [Parameter],
}

/// One parameter's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Which.
    pub parameter: Parameter,
    /// Where it began.
    pub start: f64,
    /// Its value.
    pub value: f64,
    /// Its standard deviation within the free directions.
    pub std: f64,
    /// Share of it that lies in held directions, 0 to 1.
    pub held: f64,
}

/// A combination of parameters that the motion does not determine.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldDirection {
    /// Weight of each parameter, pixels of image motion, in the order of [`Parameter::ALL`].
    pub weights: Parameters,
    /// Its standard deviation if it were solved for, pixels.
    pub std_px: f64,
}

/// The solution.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The camera.
    pub camera: Camera,
    /// Poses of the keyframes.
    pub world_from_camera: Vec<Pose>,
    /// One entry for each parameter, in the order of [`Parameter::ALL`].
    pub estimates: Vec<Estimate>,
    /// Combinations that kept their start.
    pub held: Vec<HeldDirection>,
    /// Root mean square normal residual before and after, standard deviations of depth.
    pub residual_sigmas: (f64, f64),
    /// Iterations done.
    pub n_iterations: u32,
    /// The last step was below the limit.
    pub is_converged: bool,
    /// How far the image moved from `made_with` to `camera`, pixels.
    pub moved_px: f64,
    /// Standard deviation of all free directions together, pixels.
    pub std_px: f64,
}

/// Why there is no calibration.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// Too little was seen.
    #[error("{found} pairs of keyframes see the same surfaces, expected at least {expected}")]
    FewPairs {
        /// Pairs with enough matches.
        found: usize,
        /// Least number.
        expected: usize,
    },
    /// The poses' system has no solution.
    #[error("the pairs of keyframes do not determine their poses")]
    Undetermined,
    /// The solution is no camera.
    #[error("the solution is no camera: {0}")]
    Camera(#[from] CameraError),
    /// The lens would map two rays to one pixel.
    #[error("the solution's distortion folds the image over: {distortion:?}")]
    Folded {
        /// `k1 k2 p1 p2 k3`.
        distortion: [f64; 5],
    },
}

/// Solves for the camera and all poses at once. The same bits for any number of threads.
///
/// # Errors
/// Too little overlap, or a solution that is no camera.
pub fn calibrate(problem: &Problem<'_>, progress: &mut dyn FnMut()) -> Result<Calibration, CalibrationError> {
    let start = of_camera(problem.start);
    let mut camera = problem.made_with.clone();
    let mut poses: Vec<Pose> = problem.keyframes.iter().map(|k| k.world_from_camera).collect();
    let velocities: Vec<Twist> = problem.keyframes.iter().map(|k| k.velocity).collect();
    let sizes = sizes::one_pixel(problem.start, &velocities, median_depth_m(problem));
    // What is far from the frames' centre or small waits until the rest is about right.
    let mut waits: Vec<Parameter> = problem.fixed.iter().chain(&LATE).copied().collect();
    let mut first_residual = None;
    let mut n_iterations = 0;
    loop {
        n_iterations += 1;
        let pairs = match_all(problem, &camera, &poses, n_iterations);
        progress();
        if pairs.len() < problem.keyframes.len() || pairs.len() < 3 {
            return Err(CalibrationError::FewPairs {
                found: pairs.len(),
                expected: problem.keyframes.len().max(3),
            });
        }
        let residual = residual_sigmas(&pairs);
        let first = *first_residual.get_or_insert(residual);
        if n_iterations == FIRST_LATE {
            waits = problem.fixed.to_vec();
        }
        let sizes = without(&sizes, &waits);
        let reduced = system::reduce(&pairs, poses.len()).ok_or(CalibrationError::Undetermined)?;
        let all = directions::directions(&reduced, &sizes);
        let (free, held): (Vec<Direction>, Vec<Direction>) =
            all.into_iter().partition(|d| d.is_free(problem.hold_px));
        let present = of_camera(&camera);
        let mut step = directions::step(&reduced, &free, &sizes, (&start, &present));
        let mut step_px = sizes::in_pixels(&step, &sizes).norm();
        if step_px > LARGEST_STEP_PX {
            step *= LARGEST_STEP_PX / step_px;
            step_px = LARGEST_STEP_PX;
        }
        // A step that leads beyond what can be a camera is taken in part.
        let mut tried = with_parameters(&camera, &(present + step));
        for _ in 0..MOST_HALVINGS {
            if check(&tried).is_ok() {
                break;
            }
            (step, step_px) = (0.5 * step, 0.5 * step_px);
            tried = with_parameters(&camera, &(present + step));
        }
        if let Err(error) = check(&tried) {
            // The highest power of a lens bends corners that hardly any surface fills.
            if waits.contains(&Parameter::K3) || n_iterations >= MAX_ITERATIONS {
                return Err(error);
            }
            waits.push(Parameter::K3);
            step = Parameters::zeros();
            step[K3] = start[K3] - present[K3];
            step_px = LARGEST_STEP_PX;
            tried = with_parameters(&camera, &(present + step));
            check(&tried)?;
        }
        let values = present + step;
        camera = tried;
        for (index, pose) in poses.iter_mut().enumerate() {
            *pose = compose_normalised(pose, &reduced.pose_step(index, &step));
        }
        let std_px = free.iter().map(|d| d.std_px * d.std_px).sum::<f64>().sqrt();
        let is_converged =
            n_iterations > FIRST_LATE && step_px < (CONVERGED_SHARE * std_px).max(CONVERGED_PX);
        if is_converged || n_iterations >= MAX_ITERATIONS {
            let moved = sizes::in_pixels(&(values - of_camera(problem.made_with)), &sizes).norm();
            return Ok(Calibration {
                estimates: estimates(&reduced, &free, &sizes, (&start, &values)),
                held: held
                    .iter()
                    .filter(|d| !is_fixed(d, &sizes))
                    .map(|d| HeldDirection { weights: d.vector, std_px: d.std_px })
                    .collect(),
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

/// Whether a direction lies in parameters that are fixed anyway.
fn is_fixed(direction: &Direction, sizes: &Parameters) -> bool {
    let unfixed = direction.vector.iter().zip(sizes.iter()).filter(|(_, size)| **size > 0.0);
    unfixed.map(|(weight, _)| weight * weight).sum::<f64>() < 1e-6
}

fn estimates(
    reduced: &Reduced,
    free: &[Direction],
    sizes: &Parameters,
    (start, values): (&Parameters, &Parameters),
) -> Vec<Estimate> {
    let covariance = directions::covariance(reduced, free, sizes);
    let of = |(k, parameter): (usize, Parameter)| Estimate {
        parameter,
        start: start[k],
        value: values[k],
        std: covariance[(k, k)].max(0.0).sqrt(),
        held: (1.0 - free.iter().map(|d| d.vector[k] * d.vector[k]).sum::<f64>()).clamp(0.0, 1.0),
    };
    Parameter::ALL.into_iter().enumerate().map(of).collect()
}

/// A keyframe made ready under the present camera.
struct Prepared {
    vertices: Vec<Vertex>,
    queries: Queries,
    shutter: ShutterTable,
}

fn match_all(problem: &Problem<'_>, camera: &Camera, poses: &[Pose], iteration: u32) -> Vec<PairSums> {
    let grid = problem.grid;
    let warp = SurfaceWarp::new(problem.made_with, camera, grid, problem.offset_px);
    let prepare = |keyframe: &Keyframe<'_>| {
        let vertices = warp.apply(keyframe.vertices);
        let mut samples = Vec::new();
        let surface = SurfaceView { grid, vertices: &vertices };
        Sampler::default().draw(&surface, keyframe.frame_index, problem.registration, &mut samples);
        let shutter =
            ShutterTable::new(camera, &keyframe.velocity, grid.height, grid.step, problem.offset_px);
        let mut queries = Queries::default();
        queries.fill(&samples, &shutter);
        Prepared { vertices, queries, shutter }
    };
    let prepared: Vec<Prepared> = problem.keyframes.par_iter().map(prepare).collect();
    let limits = MatchLimits {
        first_distance_m: problem.first_distance_m as f32,
        progress: if iteration == 1 { 0.5 } else { 1.0 },
        pose_sigma_m: 0.0,
        brightness: false,
    };
    let rule =
        Rule { noise: problem.noise, epsilon: f64::from(problem.registration.weight.covariance_epsilon) };
    let matcher = || {
        Matcher::new(GridCamera::new(camera, grid, problem.offset_px), problem.noise, problem.registration)
    };
    let found: Vec<Option<PairSums>> = problem
        .pairs
        .par_iter()
        .map_init(matcher, |matcher, &(query, target)| {
            let older = &prepared[target];
            let surface = SurfaceView { grid, vertices: &older.vertices };
            let view = Target { surface, shutter: &older.shutter, tree: None };
            let at = poses[target].inverse() * poses[query];
            let selection = Selection { count: problem.queries_per_pair, shift: target };
            let (_, report) = matcher.match_pair(&prepared[query].queries, selection, &view, &at, &limits);
            let is_enough = report.n_matches as usize >= MIN_MATCHES
                && f64::from(report.n_matches) >= problem.min_overlap * f64::from(report.n_queries);
            let velocity = |k: usize| (k, problem.keyframes[k].velocity);
            let sides = Sides { query: velocity(query), target: velocity(target) };
            is_enough.then(|| residuals::sum(camera, &rule, &matcher.matches(), &at, &sides))
        })
        .collect();
    found.into_iter().flatten().collect()
}

fn residual_sigmas(pairs: &[PairSums]) -> f64 {
    let (sum, n) = pairs.iter().fold((0.0, 0), |(sum, n), pair| (sum + pair.sigmas_sq, n + pair.n_matches));
    (sum / n.max(1) as f64).sqrt()
}

/// The median depth of all keyframes' usable vertices.
fn median_depth_m(problem: &Problem<'_>) -> f64 {
    let inner = problem.keyframes.iter().flat_map(|k| k.vertices.iter().step_by(7)).filter(|v| v.is_inner());
    let mut depths: Vec<f32> = inner.map(|v| v.position[2]).collect();
    if depths.is_empty() {
        return 1.0;
    }
    let middle = depths.len() / 2;
    f64::from(*depths.select_nth_unstable_by(middle, f32::total_cmp).1)
}

/// A camera whose lens maps different rays of the image to different pixels.
fn check(camera: &Camera) -> Result<(), CalibrationError> {
    camera.check()?;
    let (bottom, right) = (f64::from(camera.height), f64::from(camera.width));
    for row in 0..=8 {
        for column in 0..=8 {
            let (row, column) = (bottom * f64::from(row) / 8.0, right * f64::from(column) / 8.0);
            let ray = camera.ray(row, column);
            let [a, b, d] = camera.distortion_slope(ray.x, ray.y);
            let back = camera.project(&ray);
            let returns = back.is_some_and(|(r, c)| (r - row).abs() < 0.01 && (c - column).abs() < 0.01);
            if !(a * d - b * b > 0.05) || !returns {
                return Err(CalibrationError::Folded { distortion: camera.distortion });
            }
        }
    }
    Ok(())
}
