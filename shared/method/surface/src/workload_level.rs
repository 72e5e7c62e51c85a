//! Workload levels for load shedding: less work per frame in an overloaded live run.
//!
//! The level is part of a frame's input: the aligner's shell, which sees the clock, decides it; it
//! travels with the surface and is journaled with the frame. What it means is a pure function of it and
//! the settings.

use serde::{Deserialize, Serialize};

/// Amount of work per frame: each level does less than the one before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WorkloadLevel {
    /// What the settings ask for.
    #[default]
    Full,
    /// Half of the samples and correspondences.
    FewerPoints,
    /// That, and a window of three poses at most.
    SmallWindow,
    /// A quarter of the samples and correspondences, a window of two, no filter.
    Least,
}

impl WorkloadLevel {
    /// All levels from full to least.
    pub const ALL: [WorkloadLevel; 4] =
        [WorkloadLevel::Full, WorkloadLevel::FewerPoints, WorkloadLevel::SmallWindow, WorkloadLevel::Least];

    /// Number of the level: 0, full, to 3, least.
    pub fn level(self) -> usize {
        self as usize
    }

    /// The level of this number, where there is one.
    pub fn from_level(level: u64) -> Option<Self> {
        Self::ALL.get(usize::try_from(level).ok()?).copied()
    }

    /// One level down; the last one stays.
    #[must_use]
    pub fn lowered(self) -> Self {
        Self::ALL.get(self.level() + 1).copied().unwrap_or(WorkloadLevel::Least)
    }

    /// One level up; the first one stays.
    #[must_use]
    pub fn raised(self) -> Self {
        Self::ALL[self.level().saturating_sub(1)]
    }

    /// What it means, for the log.
    pub fn describe(self) -> &'static str {
        match self {
            WorkloadLevel::Full => "all that the settings ask for",
            WorkloadLevel::FewerPoints => "half of the points",
            WorkloadLevel::SmallWindow => "half of the points, a window of three",
            WorkloadLevel::Least => "a quarter of the points, a window of two, no filter",
        }
    }

    /// So many samples or correspondences where the settings ask for `full`; never so few that a
    /// frame could not be aligned.
    pub fn points(self, full: u32) -> u32 {
        const LEAST: u32 = 100;
        let wanted = match self {
            WorkloadLevel::Full => full,
            WorkloadLevel::FewerPoints | WorkloadLevel::SmallWindow => full / 2,
            WorkloadLevel::Least => full / 4,
        };
        wanted.max(LEAST.min(full))
    }

    /// So many poses of the window where the settings ask for `full`.
    pub fn window(self, full: u32) -> u32 {
        match self {
            WorkloadLevel::Full | WorkloadLevel::FewerPoints => full,
            WorkloadLevel::SmallWindow => full.min(3),
            WorkloadLevel::Least => full.min(2),
        }
    }

    /// So many rings of the filter where the settings ask for `full`.
    pub fn filter_rings(self, full: u32) -> u32 {
        if self == WorkloadLevel::Least { 0 } else { full }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_level_does_no_more_than_the_one_before() {
        for (level, workload) in WorkloadLevel::ALL.into_iter().enumerate() {
            assert_eq!((workload.level(), WorkloadLevel::from_level(level as u64)), (level, Some(workload)));
            let lower = workload.lowered();
            assert!(lower.raised() == workload || workload == WorkloadLevel::Least);
            for full in [50, 100, 800, 4000] {
                assert!(lower.points(full) <= workload.points(full) && lower.points(full) >= full.min(100));
            }
            assert!(lower.window(5) <= workload.window(5) && lower.window(1) == 1);
            assert!(lower.filter_rings(2) <= workload.filter_rings(2));
        }
        assert_eq!(WorkloadLevel::Full.points(7), 7);
        assert_eq!((WorkloadLevel::from_level(4), WorkloadLevel::from_level(u64::MAX)), (None, None));
    }
}
