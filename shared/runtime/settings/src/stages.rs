//! Supervision of the stages: restarts, threads and memory. Cores and priorities are the system's
//! own business: `taskset`, `nice`, or the unit files of systemd.

use serde::{Deserialize, Serialize};

/// When a dead stage is started again. Under each policy the third death of its own on one frame,
/// or from its memory limit, is the last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Restart {
    /// However often it dies.
    #[default]
    Always,
    /// Never: its first death ends the run, which `resume` can go on with.
    Never,
}

/// The supervision of the stages.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StageSettings {
    /// When a stage is started again after its death.
    pub restart: Restart,
    /// Threads in each stage that work on one frame or request; 0: as many as there are cores. No
    /// result depends on it.
    pub threads: u32,
    /// Private memory that each stage may use, megabytes (1e6 bytes); 0: no limit. Shared memory and
    /// the mapped map do not count.
    pub memory_mb: u64,
}

impl StageSettings {
    /// Checks every range.
    ///
    /// # Errors
    /// `key is value, expected rule` for the first that cannot be.
    pub fn check(&self) -> Result<(), String> {
        let Self { threads, memory_mb, .. } = self;
        if *threads > 1024 {
            return Err(format!("threads is {threads}, expected a number from 0 (as many as cores) to 1024"));
        }
        if *memory_mb != 0 && !(16..=1_000_000_000).contains(memory_mb) {
            return Err(format!(
                "memory_mb is {memory_mb}, expected 0 (no limit) or a number from 16 to 1000000000"
            ));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_checked() {
        StageSettings::default().check().unwrap();
        let small = StageSettings { memory_mb: 1, ..StageSettings::default() };
        assert!(small.check().unwrap_err().starts_with("memory_mb is 1, expected 0 (no limit) or"));
        let many = StageSettings { threads: 2000, ..StageSettings::default() };
        assert!(many.check().unwrap_err().starts_with("threads is 2000, expected"));
    }
}
