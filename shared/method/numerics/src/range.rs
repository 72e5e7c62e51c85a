//! Settings whose ranges are checked, NaN included.

/// A setting outside its range.
#[derive(Clone, Debug, PartialEq)]
pub struct SettingError {
    /// Key inside its table.
    pub key: &'static str,
    /// What was found.
    pub found: String,
    /// What must hold.
    pub rule: String,
}

impl std::fmt::Display for SettingError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{} is {}, expected {}", self.key, self.found, self.rule)
    }
}

impl std::error::Error for SettingError {}

/// Checks `low <= value <= high`; written so that NaN fails. A value that is a limit in single precision, in
/// which many settings are kept, is that limit.
///
/// # Errors
/// Names key, value and rule.
pub fn check_range(key: &'static str, value: f64, low: f64, high: f64) -> Result<(), SettingError> {
    let is_limit = |limit: f64| value as f32 == limit as f32;
    if value >= low && value <= high || is_limit(low) || is_limit(high) {
        return Ok(());
    }
    Err(SettingError { key, found: value.to_string(), rule: format!("a number from {low} to {high}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_belong_to_the_range_in_single_precision_too() {
        for limit in [1e-6, 0.1, 0.3, 1.0] {
            assert_eq!(check_range("x", f64::from(limit as f32), limit, limit), Ok(()), "{limit}");
        }
        for value in [0.99e-6, 1.01, f64::NAN, f64::INFINITY] {
            let error = check_range("x", value, 1e-6, 1.0).unwrap_err().to_string();
            assert_eq!(error, format!("x is {value}, expected a number from 0.000001 to 1"));
        }
    }
}
