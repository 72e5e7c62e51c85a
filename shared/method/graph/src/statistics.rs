//! Uncertainty of a pose: covariance (eq. 14) and entropy (eq. 15) from the information matrix
//! (method 9.2-9.4).

use tessera_geometry::Matrix6;

/// Part of its standard deviation by which an unknown may be off its optimum, root mean square.
pub(crate) const STILL_SIGMAS: f64 = 0.01;

/// Inverse of an information matrix; `None` where a direction has no information.
pub fn covariance_from_information(information: &Matrix6) -> Option<Matrix6> {
    information.cholesky().map(|factor| factor.inverse())
}

/// The covariance of Censi (eq. 14) in metres and radians, translation first:
/// `Sigma_T = H^-1 (sum J^T Omega (C_b + R C_a R^T) Omega J) H^-1`.
///
/// With weights that follow the depth noise, `C = kappa(z) Sigma` (method 9.3), the middle term is
/// H itself times a constant, so that `Sigma_T = factor H^-1` with `factor = sigma(1 m)^2 / eps`.
pub fn metric_covariance(information: &Matrix6, factor: f64) -> Option<Matrix6> {
    covariance_from_information(information).map(|c| c * factor)
}

/// The entropy `H(T) = ln det Sigma_T` (eq. 15) in nats: with `H = L L^T`,
/// `ln det (factor H^-1) = 6 ln factor - 2 sum ln L_kk`. `None` where a direction has no information
/// (method T62).
pub fn entropy_of_covariance(information: &Matrix6, factor: f64) -> Option<f64> {
    let cholesky = information.cholesky()?;
    let l = cholesky.l_dirty();
    let half: f64 = (0..6).map(|k| libm::log(l[(k, k)])).sum();
    Some(6.0 * libm::log(factor) - 2.0 * half)
}
