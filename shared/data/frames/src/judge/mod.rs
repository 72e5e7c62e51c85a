//! The judge of a camera: one posterior of its focal length and one of its depth units, over all
//! evidence. `check`, `run`, `calibrate`, the verdict and the report state what it finds, and no other
//! module has a threshold for either (method 15.1).
//!
//! Pure functions of numbers: what measures them lies elsewhere.

mod focal;
mod lattice;
mod units;

pub use focal::{FocalEvidence, FocalPosterior, FocalSource, judge_focal};
pub use lattice::{Lattice, depth_lattice};
pub use units::{UnitsEvidence, UnitsPosterior, judge_units};

/// Error rate: a camera file that is right raises an alarm in one run of so many.
pub const RUNS_PER_FALSE_ALARM: u32 = 1000;
/// Two-sided quantile of the normal distribution at that rate.
pub(crate) const Z: f64 = 3.2905;

/// Factor on a standard error estimated from few independent groups, so that `Z` of it is the quantile of
/// Student's distribution with these degrees of freedom: the Cornish-Fisher expansion (Fisher and Cornish
/// 1960) to the third order.
pub fn student_inflation(degrees_of_freedom: f64) -> f64 {
    let (n, z) = (degrees_of_freedom.max(1.0), Z);
    let terms = [
        (z.powi(2) + 1.0) / 4.0,
        (5.0 * z.powi(4) + 16.0 * z.powi(2) + 3.0) / 96.0,
        (3.0 * z.powi(6) + 19.0 * z.powi(4) + 17.0 * z.powi(2) - 15.0) / 384.0,
    ];
    1.0 + terms[0] / n + terms[1] / (n * n) + terms[2] / (n * n * n)
}

#[cfg(test)]
mod tests {
    use super::student_inflation;

    #[test]
    fn few_groups_widen_as_student_has_it() {
        // Quantiles of 0.9995 from tables.
        for (n, quantile) in [(5.0, 6.869), (11.0, 4.437), (30.0, 3.646), (1e9, 3.2905)] {
            let found = 3.2905 * student_inflation(n);
            assert!((found / quantile - 1.0).abs() < 0.03, "{n}: {found} for {quantile}");
        }
    }
}
