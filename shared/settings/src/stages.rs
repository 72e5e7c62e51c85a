//! How each stage is supervised: when it is started again, and how much memory it may use.

use serde::{Deserialize, Serialize};

/// When a dead stage is started again. Under each policy the third death of its own on one frame,
/// or from its memory limit, is the last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Restart {
    /// However often it dies.
    #[default]
    Always,
    /// At most [`StageSettings::restarts`] times within [`StageSettings::restarts_within_s`].
    Limited,
    /// Never: its first death ends the run, which `resume` can go on with.
    Never,
}

/// The supervision of one stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StageSettings {
    /// When it is started again after its death.
    pub restart: Restart,
    /// Restarts under `restart = "limited"`.
    pub restarts: u32,
    /// Time in which they are counted, seconds.
    pub restarts_within_s: f64,
    /// Private memory that it may use, megabytes (1e6 bytes); 0: no limit. Shared memory and the
    /// mapped map do not count.
    pub memory_mb: u64,
}

impl Default for StageSettings {
    fn default() -> Self {
        Self { restart: Restart::Always, restarts: 10, restarts_within_s: 60.0, memory_mb: 0 }
    }
}

impl StageSettings {
    fn check(&self, stage: &str) -> Result<(), String> {
        let Self { restarts, restarts_within_s, memory_mb, .. } = self;
        let refuse = |key: &str, value: &dyn std::fmt::Display, rule: &str| {
            Err(format!("{stage}.{key} is {value}, expected {rule}"))
        };
        if !(0..=1_000_000).contains(restarts) {
            return refuse("restarts", restarts, "a number from 0 to 1000000");
        }
        if !(0.1..=1e6).contains(restarts_within_s) {
            return refuse("restarts_within_s", restarts_within_s, "a number from 0.1 to 1000000");
        }
        if *memory_mb != 0 && !(16..=1_000_000_000).contains(memory_mb) {
            return refuse("memory_mb", memory_mb, "0 (no limit) or a number from 16 to 1000000000");
        }
        Ok(())
    }
}

/// The supervision of all stages.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StagesSettings {
    /// Reads the source.
    pub sensor: StageSettings,
    /// Makes surfaces of frames.
    pub reconstruct: StageSettings,
    /// Aligns surfaces to the map.
    pub align: StageSettings,
    /// Optimises all keyframes.
    pub optimise: StageSettings,
}

impl StagesSettings {
    /// Checks every range; NaN is outside of each.
    ///
    /// # Errors
    /// `key is value, expected rule` for the first that cannot be.
    pub fn check(&self) -> Result<(), String> {
        let Self { sensor, reconstruct, align, optimise } = self;
        [("sensor", sensor), ("reconstruct", reconstruct), ("align", align), ("optimise", optimise)]
            .iter()
            .try_for_each(|(name, stage)| stage.check(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stage_is_checked_by_name() {
        StagesSettings::default().check().unwrap();
        let with = |align| StagesSettings { align, ..StagesSettings::default() }.check().unwrap_err();
        let nan = StageSettings { restarts_within_s: f64::NAN, ..StageSettings::default() };
        assert_eq!(with(nan), "align.restarts_within_s is NaN, expected a number from 0.1 to 1000000");
        let small = StageSettings { memory_mb: 1, ..StageSettings::default() };
        assert!(with(small).starts_with("align.memory_mb is 1, expected 0 (no limit) or"));
    }
}
