//! Result of a calibration, and its errors.

use crate::directions::Directions;
use crate::parameters::{Parameter, Parameters};
use crate::sizes;
use crate::system::CameraMatrix;
use tessera_geometry::{Camera, CameraError, Pose};

/// One parameter's result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// Which.
    pub parameter: Parameter,
    /// Where it began.
    pub start: f64,
    /// Its value.
    pub value: f64,
    /// Its standard deviation by the frames and the start together.
    pub std: f64,
    /// Share of it that is the start's rather than the frames', 0 to 1.
    pub held: f64,
}

/// A combination of parameters that stays nearer to its start than to the frames' estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct HeldDirection {
    /// Weight of each parameter, pixels of image motion, in the order of [`Parameter::ALL`].
    pub weights: Parameters,
    /// Its standard deviation by the frames alone, pixels.
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
    /// Combinations that the motion does not determine.
    pub held: Vec<HeldDirection>,
    /// Root mean square normal residual before and after, standard deviations of depth.
    pub residual_sigmas: (f64, f64),
    /// Iterations done.
    pub n_iterations: u32,
    /// The last step was below the limit.
    pub is_converged: bool,
    /// How far the image moved from `made_with` to `camera`, pixels.
    pub moved_px: f64,
    /// Root of the sum of all parameters' variances, pixels.
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
    /// The solution is not a camera.
    #[error("the solution is no camera: {0}")]
    Camera(#[from] CameraError),
    /// The lens would map two rays to one pixel.
    #[error("the solution's distortion folds the image over: {distortion:?}")]
    Folded {
        /// `k1 k2 p1 p2 k3`.
        distortion: [f64; 5],
    },
}

/// Root of the sum of all parameters' variances, each in pixels of image motion.
pub(crate) fn std_px(covariance: &CameraMatrix, sizes: &Parameters) -> f64 {
    sizes::in_pixels(&covariance.diagonal().map(|variance| variance.max(0.0).sqrt()), sizes).norm()
}

/// Directions that stay nearer to the start than to the frames' estimate.
pub(crate) fn held_directions(directions: &Directions, sizes: &Parameters) -> Vec<HeldDirection> {
    let in_pixels = |vector| sizes::in_pixels(&directions.in_parameters(vector), sizes);
    directions
        .all
        .iter()
        .filter(|d| d.share() < 0.5)
        .map(|d| (in_pixels(d), d.std))
        .filter(|(weights, _)| weights.norm() > 0.0)
        .map(|(weights, std)| HeldDirection { weights: weights.normalize(), std_px: std * weights.norm() })
        .collect()
}

/// Each parameter with what is known of it.
pub(crate) fn estimates(
    directions: &Directions,
    (start, values): (&Parameters, &Parameters),
) -> Vec<Estimate> {
    let (covariance, held) = (directions.covariance(), directions.held());
    let of = |(k, parameter): (usize, Parameter)| Estimate {
        parameter,
        start: start[k],
        value: values[k],
        std: covariance[(k, k)].max(0.0).sqrt(),
        held: held[k],
    };
    Parameter::ALL.into_iter().enumerate().map(of).collect()
}

/// A camera whose lens maps different rays of the image to different pixels.
pub(crate) fn check(camera: &Camera) -> Result<(), CalibrationError> {
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
