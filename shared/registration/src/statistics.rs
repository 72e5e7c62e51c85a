//! How certain a pose is: covariance and entropy from the information matrix (SPEC 9.2-9.4).

use tessera_geometry::Matrix6;

/// Inverse of an information matrix; `None` where a direction has no information.
pub fn covariance_from_information(information: &Matrix6) -> Option<Matrix6> {
    information.cholesky().map(|factor| factor.inverse())
}

/// The covariance of Censi in metric units: with weights that follow the depth noise, the middle
/// term of eq. 14 is the information itself times a constant, `factor = sigma^2 / epsilon`.
pub fn metric_covariance(information: &Matrix6, factor: f64) -> Option<Matrix6> {
    covariance_from_information(information).map(|c| c * factor)
}

/// Entropy `ln det Sigma` (eq. 15), by the Cholesky factor of the information: `None` where a
/// direction has no information (TRAPS 62).
pub fn entropy_of_covariance(information: &Matrix6, factor: f64) -> Option<f64> {
    let cholesky = information.cholesky()?;
    let l = cholesky.l_dirty();
    let half: f64 = (0..6).map(|k| libm::log(l[(k, k)])).sum();
    Some(6.0 * libm::log(factor) - 2.0 * half)
}
