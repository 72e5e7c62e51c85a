//! Restart policy of a dead stage: pure, so that it is tested.

use std::time::{Duration, Instant};
use tessera_settings::{Restart, StageSettings};

/// Deaths of its own on one frame after which a stage is given up.
const POISON: u32 = 3;
/// Time within which deaths from the memory limit are counted.
const MEMORY_WITHIN: Duration = Duration::from_secs(60);
/// Pause after the first death without progress; doubled with each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(20);
const LONGEST_PAUSE: Duration = Duration::from_secs(2);
/// Longest pause after a kill from outside, which is no sign of a fault in the stage.
const LONGEST_PAUSE_AFTER_KILL: Duration = Duration::from_millis(80);

/// How a stage died.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Death {
    /// When.
    pub at: Instant,
    /// By its own doing (an error, a panic, a bad access, a hang), not by a kill from outside.
    pub is_own: bool,
    /// It wanted more memory than it may use.
    pub is_memory: bool,
    /// Whether it had done anything in this life.
    pub had_progress: bool,
    /// The frame (or request) it had in hand.
    pub index: u64,
}

/// What to do about a death.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RestartDecision {
    /// Start it again after a pause.
    Again(Duration),
    /// Give the run up.
    GiveUp,
}

/// The deaths of one stage.
#[derive(Debug, Default)]
pub(crate) struct History {
    without_progress: u32,
    /// The frame of the last deaths of its own, and how many there were on it.
    poison: Option<(u64, u32)>,
    /// Deaths from the memory limit.
    memory: Vec<Instant>,
}

impl History {
    /// Takes a death in and decides.
    pub(crate) fn judge(&mut self, death: &Death, settings: &StageSettings) -> RestartDecision {
        self.without_progress = if death.had_progress { 0 } else { self.without_progress.saturating_add(1) };
        if death.is_own {
            let before = self.poison.filter(|(index, _)| *index == death.index).map_or(0, |(_, n)| n);
            self.poison = Some((death.index, before.saturating_add(1)));
        }
        self.memory.extend(death.is_memory.then_some(death.at));
        self.memory.retain(|at| death.at.saturating_duration_since(*at) <= MEMORY_WITHIN);
        if settings.restart == Restart::Never || self.is_poisoned() || self.memory.len() >= POISON as usize {
            return RestartDecision::GiveUp;
        }
        let longest = if death.is_own { LONGEST_PAUSE } else { LONGEST_PAUSE_AFTER_KILL };
        RestartDecision::Again(match self.without_progress {
            0 => Duration::ZERO,
            n => FIRST_PAUSE.saturating_mul(1 << n.saturating_sub(1).min(10)).min(longest),
        })
    }

    /// Whether one frame has killed it as often as is allowed.
    pub(crate) fn is_poisoned(&self) -> bool {
        self.n_own_deaths() >= POISON
    }

    /// Deaths of its own on the frame that killed it last.
    pub(crate) fn n_own_deaths(&self) -> u32 {
        self.poison.map_or(0, |(_, n)| n)
    }

    /// Deaths in a row without anything done between them.
    pub(crate) fn n_without_progress(&self) -> u32 {
        self.without_progress
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn death(at_s: u64, is_own: bool, had_progress: bool, index: u64) -> (Death, StageSettings) {
        let at = Instant::now() + Duration::from_secs(at_s);
        (Death { at, is_own, is_memory: false, had_progress, index }, StageSettings::default())
    }

    fn judge(history: &mut History, (death, settings): (Death, StageSettings)) -> RestartDecision {
        history.judge(&death, &settings)
    }

    #[test]
    fn kills_from_outside_are_forgiven_without_end_and_without_pause() {
        let mut history = History::default();
        for k in 0..1000 {
            assert_eq!(judge(&mut history, death(k, false, true, 7)), RestartDecision::Again(Duration::ZERO));
        }
    }

    #[test]
    fn the_third_death_of_its_own_on_one_frame_is_the_last() {
        let mut history = History::default();
        assert!(matches!(judge(&mut history, death(0, true, true, 7)), RestartDecision::Again(_)));
        assert!(matches!(judge(&mut history, death(1, true, false, 7)), RestartDecision::Again(_)));
        // A kill from outside in between changes nothing.
        assert!(matches!(judge(&mut history, death(2, false, false, 7)), RestartDecision::Again(_)));
        assert_eq!(judge(&mut history, death(3, true, false, 7)), RestartDecision::GiveUp);
        let mut other = History::default();
        for index in 0..50 {
            assert_ne!(judge(&mut other, death(index, true, true, index)), RestartDecision::GiveUp);
        }
    }

    #[test]
    fn pauses_grow_only_without_progress() {
        let mut history = History::default();
        let pauses: Vec<u128> = (0..12)
            .map(|k| match judge(&mut history, death(k, true, false, k)) {
                RestartDecision::Again(pause) => pause.as_millis(),
                RestartDecision::GiveUp => 0,
            })
            .collect();
        assert_eq!(pauses[..4], [20, 40, 80, 160]);
        assert_eq!(pauses[11], 2000);
        let after_kill = judge(&mut history, death(19, false, false, 0));
        assert_eq!(after_kill, RestartDecision::Again(LONGEST_PAUSE_AFTER_KILL));
        assert_eq!(judge(&mut history, death(20, false, true, 0)), RestartDecision::Again(Duration::ZERO));
    }

    #[test]
    fn the_third_death_from_the_memory_limit_is_the_last_on_whatever_frame() {
        let mut history = History::default();
        let verdicts = [0, 1, 100, 101, 102].map(|s| {
            let (death, settings) = death(s, true, true, s);
            history.judge(&Death { is_memory: true, ..death }, &settings) == RestartDecision::GiveUp
        });
        assert_eq!(verdicts, [false, false, false, false, true]);
    }

    #[test]
    fn a_policy_of_no_restarts_is_kept() {
        let mut history = History::default();
        let (first, settings) = death(0, false, true, 0);
        let never = StageSettings { restart: Restart::Never, ..settings };
        assert_eq!(history.judge(&first, &never), RestartDecision::GiveUp);
    }
}
