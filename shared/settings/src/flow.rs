//! How frames move between the processes, what is forced to disk, and when a process is restarted.

use serde::{Deserialize, Serialize};

/// When what is written is forced to disk. A killed process loses nothing under any of them; the
/// question is a power loss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fsync {
    /// Leave it to the operating system.
    #[default]
    Never,
    /// At each keyframe, correction and at the end.
    Keyframe,
    /// At each frame.
    Always,
}

/// When a dead stage is started again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Restart {
    /// Always, unless it dies of its own three times on one frame.
    #[default]
    Always,
    /// At most [`FlowSettings::restarts`] times within [`FlowSettings::restarts_within_s`].
    Limited,
    /// Never.
    Never,
}

/// Flow control and supervision.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FlowSettings {
    /// Frames under way at most, W. More needs more shared memory, hardly ever more speed.
    pub window: u32,
    /// Frames that the sensor decodes ahead of the window, on spare threads.
    pub ahead: u32,
    /// When what is written is forced to disk.
    pub fsync: Fsync,
    /// When a dead stage is started again.
    pub restart: Restart,
    /// Restarts of one stage under `restart = "limited"`.
    pub restarts: u32,
    /// Time in which they are counted, seconds.
    pub restarts_within_s: f64,
    /// A stage that gives no sign of life for so long is killed and started again, seconds.
    pub hang_s: f64,
}

impl Default for FlowSettings {
    fn default() -> Self {
        Self {
            window: 4,
            ahead: 4,
            fsync: Fsync::Never,
            restart: Restart::Always,
            restarts: 10,
            restarts_within_s: 60.0,
            hang_s: 10.0,
        }
    }
}

impl FlowSettings {
    /// Checks every range; NaN is outside of each.
    ///
    /// # Errors
    /// `key is value, expected rule` for the first that cannot be.
    pub fn check(&self) -> Result<(), String> {
        let ranges = [
            ("window", f64::from(self.window), 1.0, 64.0),
            ("ahead", f64::from(self.ahead), 1.0, 64.0),
            ("restarts", f64::from(self.restarts), 0.0, 1e6),
            ("restarts_within_s", self.restarts_within_s, 0.1, 1e6),
            ("hang_s", self.hang_s, 0.5, 1e6),
        ];
        for (key, value, low, high) in ranges {
            if !(low..=high).contains(&value) {
                return Err(format!("{key} is {value}, expected a number from {low} to {high}"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_hold_and_nan_does_not() {
        FlowSettings::default().check().unwrap();
        let bad = FlowSettings { hang_s: f64::NAN, ..FlowSettings::default() };
        assert_eq!(bad.check().unwrap_err(), "hang_s is NaN, expected a number from 0.5 to 1000000");
        assert!(
            FlowSettings { window: 0, ..FlowSettings::default() }
                .check()
                .unwrap_err()
                .contains("window is 0")
        );
    }
}
