//! Figures that sum up a list of errors.

use serde::Serialize;

/// What the TUM scripts print with `--verbose`, in the unit of the errors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Statistics {
    /// Root of the mean square: the figure that papers quote.
    pub rmse: f64,
    /// Mean; what `evaluate_rpe.py` prints without `--verbose`.
    pub mean: f64,
    /// Median; the mean of the middle two where their number is even.
    pub median: f64,
    /// Standard deviation of the population (divided by n).
    pub std: f64,
    /// Smallest error.
    pub min: f64,
    /// Largest error.
    pub max: f64,
}

impl Statistics {
    /// Sums up `errors`; `None` if there are none.
    pub fn of(errors: &[f64]) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let half = sorted.len() / 2;
        let median =
            if sorted.len() % 2 == 1 { sorted[half] } else { 0.5 * (sorted[half - 1] + sorted[half]) };
        Some(Self {
            rmse: (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
            mean,
            median,
            std: (errors.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / n).sqrt(),
            min: sorted[0],
            max: sorted[sorted.len() - 1],
        })
    }

    /// All figures times `factor`, for instance from radians to degrees.
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            rmse: self.rmse * factor,
            mean: self.mean * factor,
            median: self.median * factor,
            std: self.std * factor,
            min: self.min * factor,
            max: self.max * factor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_a_small_list() {
        let s = Statistics::of(&[3.0, 1.0, 2.0, 4.0]).unwrap();
        assert_eq!((s.mean, s.median, s.min, s.max), (2.5, 2.5, 1.0, 4.0));
        assert!((s.rmse - 7.5f64.sqrt()).abs() < 1e-15 && (s.std - 1.25f64.sqrt()).abs() < 1e-15);
        assert_eq!(Statistics::of(&[7.0]).unwrap().median, 7.0);
        assert_eq!(Statistics::of(&[]), None);
    }
}
