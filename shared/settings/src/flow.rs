//! How frames move between the processes.

use serde::{Deserialize, Serialize};

/// Flow control.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FlowSettings {}

impl FlowSettings {
    /// Checks every range; NaN is outside of each.
    ///
    /// # Errors
    /// `key is value, expected rule` for the first that cannot be.
    pub fn check(&self) -> Result<(), String> {
        Ok(())
    }
}
