//! What a pair of images tells on whether colour is of its time and place (method 14.4).

use crate::estimation::MISSED;
use crate::estimation::colour_pose::{Coupling, ParameterMatrix};
use crate::estimation::student::FREEDOM;
use tessera_geometry::{Matrix6, Vector6};

/// Standard deviation of the pose of chance matches about that of the surfaces, metres and radians: they are searched
/// near it. The most likely values on ten sets of foreign images, simulated and recorded, are .01 to .03.
const FOREIGN_SIGMA: f64 = 0.02;

/// Log-likelihood ratio of "the images are of their time and place", nats, by the poses of a pair from surfaces and
/// from features: normal equations `(N, g)` about one transform, metric and divided by their noise scales, each with a
/// prior of a metre and a radian.
///
/// The poses differ by Student's t with the covariance of both, what lag and focal ratio may move the features by
/// included (`coupling`, scaled as the features, and the covariance of the `parameters`); matches by chance lie about
/// the surfaces' pose with [`FOREIGN_SIGMA`] beside it, as those of one pair in a hundred of colour's own do. A direction
/// that the surfaces leave open tells nothing.
pub(crate) fn own_nats(
    surfaces: &(Matrix6, Vector6),
    features: &(Matrix6, Vector6),
    coupling: &Coupling,
    parameters: &ParameterMatrix,
) -> Option<f64> {
    let inverse = |normal: &Matrix6| Some((normal + Matrix6::identity()).cholesky()?.inverse());
    let [of_surfaces, of_features] = [inverse(&surfaces.0)?, inverse(&features.0)?];
    let apart = of_surfaces * surfaces.1 - of_features * features.1;
    let by_parameters = of_features * coupling;
    let own = of_surfaces + of_features + by_parameters * parameters * by_parameters.transpose();
    let foreign = own + Matrix6::identity() * (FOREIGN_SIGMA * FOREIGN_SIGMA);
    let nats = log_density(&own, &apart)? - log_density(&foreign, &apart)?;
    // A keyframe may be blurred, its stamp wrong.
    Some(libm::log((1.0 - MISSED) * libm::exp(nats) + MISSED))
}

/// Of Student's t in six dimensions, but for a constant: the noise scales of both poses are known to some degrees each.
fn log_density(covariance: &Matrix6, value: &Vector6) -> Option<f64> {
    let factor = covariance.cholesky()?;
    let squared = value.dot(&factor.solve(value));
    let freedom = 2.0 * FREEDOM;
    let log_determinant: f64 = factor.l_dirty().diagonal().iter().map(|v| 2.0 * libm::log(*v)).sum();
    Some(-0.5 * (log_determinant + (freedom + 6.0) * libm::log1p(squared / freedom)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Surfaces and features that know a pose to these deviations, and have it this far apart along the first two axes,
    /// along which lag and focal ratio move features by `coupling` times their deviations.
    fn nats(sigma: f64, apart: f64, coupling: f64) -> f64 {
        let normal = Matrix6::identity() / (sigma * sigma);
        let apart = Vector6::new(apart, apart, 0.0, 0.0, 0.0, 0.0);
        let coupling = normal.fixed_columns::<2>(0) * coupling;
        let surfaces = (normal, Vector6::zeros());
        own_nats(&surfaces, &(normal, normal * apart), &coupling, &ParameterMatrix::identity()).unwrap()
    }

    #[test]
    fn poses_that_agree_tell_for_colour_and_those_far_apart_against_it() {
        assert!(nats(0.001, 0.001, 0.0) > 5.0);
        assert!(nats(0.001, 0.1, 0.0) < -3.0);
        assert!(nats(0.5, 0.1, 0.0).abs() < 0.1, "{}: what is not known tells nothing", nats(0.5, 0.1, 0.0));
    }

    #[test]
    fn what_lag_and_focal_ratio_explain_is_not_held_against_colour() {
        assert!(nats(0.001, 0.1, 0.1) > 3.0 + nats(0.001, 0.1, 0.0));
    }
}
