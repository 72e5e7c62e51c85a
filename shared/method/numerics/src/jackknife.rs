//! The jackknife: how sure an estimate is, by those that leave out a part of the data.

/// Standard deviation of an estimate from the estimates that leave out one of equal groups of the data each
/// (Tukey 1958); 0 without any.
pub fn jackknife_sigma(without: &[f64]) -> f64 {
    let n = without.len().max(1) as f64;
    let mean = without.iter().sum::<f64>() / n;
    let squares: f64 = without.iter().map(|estimate| (estimate - mean) * (estimate - mean)).sum();
    (squares * (n - 1.0) / n).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn that_of_a_mean_is_the_standard_error() {
        let data: [f64; 5] = [1.0, 4.0, 2.0, 8.0, 5.0];
        let sum: f64 = data.iter().sum();
        let without: Vec<f64> = data.iter().map(|one| (sum - one) / 4.0).collect();
        let variance = data.iter().map(|one| (one - sum / 5.0).powi(2)).sum::<f64>() / 4.0;
        assert!((jackknife_sigma(&without) - (variance / 5.0).sqrt()).abs() < 1e-12);
        assert_eq!(jackknife_sigma(&[]), 0.0);
    }
}
