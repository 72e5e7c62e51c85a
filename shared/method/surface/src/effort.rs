//! The ladder that a live run goes down when frames come faster than they can be worked.
//!
//! An effort is part of a frame's input: it is decided by whoever sees the clock, travels with the
//! surface and is journaled with the frame. Here and in the aligner it is a pure function of the
//! settings.

use serde::{Deserialize, Serialize};

/// How much work is put into a frame: each rung does less than the one before.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effort {
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

impl Effort {
    /// All rungs from the top down.
    pub const ALL: [Effort; 4] = [Effort::Full, Effort::FewerPoints, Effort::SmallWindow, Effort::Least];

    /// Rungs below full effort: 0 to 3.
    pub fn rung(self) -> usize {
        self as usize
    }

    /// The effort so many rungs below full effort, where there is one.
    pub fn from_rung(rung: u64) -> Option<Self> {
        Self::ALL.get(usize::try_from(rung).ok()?).copied()
    }

    /// One rung down; the last one stays.
    #[must_use]
    pub fn lowered(self) -> Self {
        Self::ALL.get(self.rung() + 1).copied().unwrap_or(Effort::Least)
    }

    /// One rung up; the first one stays.
    #[must_use]
    pub fn raised(self) -> Self {
        Self::ALL[self.rung().saturating_sub(1)]
    }

    /// What it means, for the log.
    pub fn describe(self) -> &'static str {
        match self {
            Effort::Full => "all that the settings ask for",
            Effort::FewerPoints => "half of the points",
            Effort::SmallWindow => "half of the points, a window of three",
            Effort::Least => "a quarter of the points, a window of two, no filter",
        }
    }

    /// So many samples or correspondences where the settings ask for `full`; never so few that a
    /// frame could not be aligned.
    pub fn points(self, full: u32) -> u32 {
        const LEAST: u32 = 100;
        let wanted = match self {
            Effort::Full => full,
            Effort::FewerPoints | Effort::SmallWindow => full / 2,
            Effort::Least => full / 4,
        };
        wanted.max(LEAST.min(full))
    }

    /// So many poses of the window where the settings ask for `full`.
    pub fn window(self, full: u32) -> u32 {
        match self {
            Effort::Full | Effort::FewerPoints => full,
            Effort::SmallWindow => full.min(3),
            Effort::Least => full.min(2),
        }
    }

    /// So many rings of the filter where the settings ask for `full`.
    pub fn filter_rings(self, full: u32) -> u32 {
        if self == Effort::Least { 0 } else { full }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_rung_does_no_more_than_the_one_above() {
        for (rung, effort) in Effort::ALL.into_iter().enumerate() {
            assert_eq!((effort.rung(), Effort::from_rung(rung as u64)), (rung, Some(effort)));
            let lower = effort.lowered();
            assert!(lower.raised() == effort || effort == Effort::Least);
            for full in [50, 100, 800, 4000] {
                assert!(lower.points(full) <= effort.points(full) && lower.points(full) >= full.min(100));
            }
            assert!(lower.window(5) <= effort.window(5) && lower.window(1) == 1);
            assert!(lower.filter_rings(2) <= effort.filter_rings(2));
        }
        assert_eq!(Effort::Full.points(7), 7);
        assert_eq!((Effort::from_rung(4), Effort::from_rung(u64::MAX)), (None, None));
    }
}
