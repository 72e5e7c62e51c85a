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

/// Checks `low <= value <= high`; written so that NaN fails.
///
/// # Errors
/// Names key, value and rule.
pub fn check_range(key: &'static str, value: f64, low: f64, high: f64) -> Result<(), SettingError> {
    if value >= low && value <= high {
        return Ok(());
    }
    Err(SettingError { key, found: value.to_string(), rule: format!("a number from {low} to {high}") })
}
