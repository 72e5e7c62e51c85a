//! How each stage is supervised, and where it runs: restarts, memory, cores and priority.

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

/// Highest core that a set of cores can name.
const MOST_CORE: u32 = 1023;

/// The supervision of one stage, and its place on the machine.
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
    /// Processor cores that it may run on, as the system counts them; empty: all.
    pub cores: Vec<u32>,
    /// Threads that work on one frame or request; 0: as many as there are cores. No result depends
    /// on it.
    pub threads: u32,
    /// Niceness, -20 (first) to 19 (last); 0: as it was started. Below 0 the system must permit it.
    pub nice: i32,
    /// Priority under SCHED_FIFO, 1 to 99, where the system permits it; 0: not real-time.
    pub fifo: u32,
    /// Whether its memory is locked once touched, so that none of it is ever paged out.
    pub lock_memory: bool,
}

impl Default for StageSettings {
    fn default() -> Self {
        Self {
            restart: Restart::Always,
            restarts: 10,
            restarts_within_s: 60.0,
            memory_mb: 0,
            cores: Vec::new(),
            threads: 0,
            nice: 0,
            fifo: 0,
            lock_memory: false,
        }
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
        if let Some(core) = self.cores.iter().find(|core| **core > MOST_CORE) {
            return refuse("cores", core, "numbers from 0 to 1023");
        }
        if self.threads > 1024 {
            return refuse("threads", &self.threads, "a number from 0 (as many as cores) to 1024");
        }
        if !(-20..=19).contains(&self.nice) {
            return refuse("nice", &self.nice, "a number from -20 to 19");
        }
        if self.fifo > 99 {
            return refuse("fifo", &self.fifo, "0 (not real-time) or a number from 1 to 99");
        }
        if self.fifo > 0 && self.nice != 0 {
            return refuse("nice", &self.nice, "0 beside fifo, which takes its place");
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
        let far = StageSettings { cores: vec![0, 4096], ..StageSettings::default() };
        assert_eq!(with(far), "align.cores is 4096, expected numbers from 0 to 1023");
        let both = StageSettings { nice: -5, fifo: 20, ..StageSettings::default() };
        assert!(with(both).starts_with("align.nice is -5, expected 0 beside fifo"));
        let rude = StageSettings { nice: -21, ..StageSettings::default() };
        assert!(with(rude).starts_with("align.nice is -21, expected"));
    }
}
