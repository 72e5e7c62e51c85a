//! Settings of flow control, signs of life and durability.

use serde::{Deserialize, Serialize};

/// When what is written is forced to disk. What is journaled survives the death of any process under each
/// of them; what is synced survives a power cut.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fsync {
    /// At each keyframe in live runs, never in those of recordings, which can be computed again.
    #[default]
    Auto,
    /// Leave it to the operating system.
    Never,
    /// At each keyframe, correction and at the end.
    Keyframe,
    /// At each frame.
    Always,
}

impl Fsync {
    /// The same without `Auto`.
    pub fn of_run(self, is_live: bool) -> Self {
        match self {
            Self::Auto if is_live => Self::Keyframe,
            Self::Auto => Self::Never,
            stated => stated,
        }
    }
}

/// Flow control and signs of life.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FlowSettings {
    /// Frames under way at most, W, and as many that the sensor decodes ahead of them on spare threads.
    /// More needs more shared memory, hardly ever more speed.
    pub window: u32,
    /// When what is written is forced to disk.
    pub fsync: Fsync,
    /// Time without a sign of life after which a stage is killed and started again, seconds.
    pub hang_s: f64,
    /// Journal between two checkpoints, kB: what a stage that is started again reads beside the last
    /// one; 0: no checkpoints, it reads all of its journal.
    pub checkpoint_kb: u32,
    /// Disk for the surfaces of culled keyframes, megabytes. Beyond it the oldest of them are given up:
    /// the trajectory stays as it is, `map.ply` and exports lack them.
    pub culled_mb: u32,
    /// Load shedding: whether an overloaded live run puts less work into each frame before it leaves
    /// frames out.
    pub load_shedding: bool,
}

impl Default for FlowSettings {
    fn default() -> Self {
        Self {
            window: 4,
            fsync: Fsync::Auto,
            hang_s: 10.0,
            checkpoint_kb: 1024,
            culled_mb: 250,
            load_shedding: true,
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
            ("hang_s", self.hang_s, 0.5, 1e6),
            ("checkpoint_kb", f64::from(self.checkpoint_kb), 0.0, 1e6),
            ("culled_mb", f64::from(self.culled_mb), 0.0, 1e9),
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
    fn live_runs_are_synced_at_keyframes_and_what_is_stated_is_kept() {
        let default = FlowSettings::default().fsync;
        assert_eq!([true, false].map(|live| default.of_run(live)), [Fsync::Keyframe, Fsync::Never]);
        for stated in [Fsync::Never, Fsync::Keyframe, Fsync::Always] {
            assert_eq!([true, false].map(|live| stated.of_run(live)), [stated; 2]);
        }
    }

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
