//! Description of the machine of a run: measured times mean nothing without it.

use serde::{Deserialize, Serialize};
use std::fs;

/// A machine, as far as times depend on it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Machine {
    /// Name of the processor; empty where the system does not say.
    pub processor: String,
    /// Threads that may run at once.
    pub cores: usize,
    /// Memory, gigabytes (1e9 bytes).
    pub memory_gb: f64,
    /// Kernel and its release.
    pub system: String,
}

impl Machine {
    /// This one.
    pub fn this() -> Self {
        let read = |path| fs::read_to_string(path).unwrap_or_default();
        let release = read("/proc/sys/kernel/osrelease");
        Self {
            processor: value(&read("/proc/cpuinfo"), "model name").unwrap_or_default(),
            cores: std::thread::available_parallelism().map_or(0, usize::from),
            memory_gb: (kilobytes(&read("/proc/meminfo")).unwrap_or(0.0) * 1024e-8).round() / 10.0,
            system: format!("Linux {} {}", release.trim(), std::env::consts::ARCH),
        }
    }
}

/// The value behind `key`, a blank and a colon.
fn value(text: &str, key: &str) -> Option<String> {
    let line = text.lines().find(|line| line.starts_with(key))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

fn kilobytes(meminfo: &str) -> Option<f64> {
    value(meminfo, "MemTotal")?.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_system_s_files_are_understood() {
        let text = "processor\t: 0\nmodel name\t: Some CPU @ 2.5GHz\nmodel name\t: second\n";
        assert_eq!(value(text, "model name").as_deref(), Some("Some CPU @ 2.5GHz"));
        assert_eq!(kilobytes("MemTotal:       24000000 kB\nMemFree: 1 kB\n"), Some(24e6));
        assert_eq!(kilobytes(""), None);
        assert!(Machine::this().cores >= 1);
    }
}
