//! Student's t in place of the normal distribution: what a disagreement counts, as its size is known by a few frames
//! only (Lange, Little and Taylor 1989).

/// Degrees of freedom.
pub(crate) const FREEDOM: f64 = 4.0;

/// Disagreements along so many axes.
pub(crate) struct Student {
    axes: f64,
    /// Consistency at the normal distribution: `n / E[(nu + n) q / (nu + q)]` for `q` of a chi-square of `n` axes.
    pub(crate) consistency: f64,
}

/// Of one number, of a translation or a rotation, and of a pose.
pub(crate) const ONE_AXIS: Student = Student { axes: 1.0, consistency: 1.27 };
pub(crate) const THREE_AXES: Student = Student { axes: 3.0, consistency: 1.155 };
pub(crate) const SIX_AXES: Student = Student { axes: 6.0, consistency: 1.0816 };

impl Student {
    /// What a squared disagreement counts, in units of its variance.
    pub(crate) fn weight(&self, squared: f64) -> f64 {
        (FREEDOM + self.axes) / (FREEDOM + squared)
    }

    /// The same, so that the mean of weighted squares is the number of axes where the variance is right.
    pub(crate) fn consistent_weight(&self, squared: f64) -> f64 {
        self.consistency * (FREEDOM + self.axes) / (FREEDOM + squared)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weighted_squares_of_normal_numbers_are_consistent() {
        for (student, n) in [(ONE_AXIS, 1), (THREE_AXES, 3), (SIX_AXES, 6)] {
            // Density of a chi-square of n, but for a constant, by steps.
            let (mut sum, mut total) = (0.0, 0.0);
            for k in 0..400_000 {
                let q = (f64::from(k) + 0.5) * 2e-4;
                let density = libm::pow(q, 0.5 * f64::from(n) - 1.0) * libm::exp(-0.5 * q);
                sum += density * student.consistent_weight(q) * q;
                total += density;
            }
            let mean = sum / total;
            assert!((mean / f64::from(n) - 1.0).abs() < 0.005, "{n} axes: {mean}");
        }
    }
}
