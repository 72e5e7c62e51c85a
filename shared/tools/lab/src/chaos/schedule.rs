//! Schedule of faults: drawn from a seed, so that it can be repeated.

use std::time::Duration;
use tessera_messages::Stage;
use tessera_numerics::SplitMix64;

/// A kind of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultKind {
    /// SIGKILL.
    Kill,
    /// SIGSTOP, and SIGCONT after a while.
    Stop,
    /// Stopped and continued many times in a row.
    Slow,
    /// All processes stopped for longer than a stage may be silent, then continued in any order: a laptop's sleep.
    Sleep,
    /// SIGSEGV, as a bug in unsafe code would bring it.
    Segv,
    /// SIGABRT.
    Abort,
    /// A limit on memory below what is in use.
    Memory,
    /// A limit on the size of files: a full disk.
    Full,
    /// A message that is not sent.
    Drop,
    /// A message full of nonsense.
    Corrupt,
    /// A message with an index far ahead.
    IndexJump,
    /// A disk that takes nothing more: the run ends, and `resume` goes on.
    SyncFails,
    /// All processes killed, and a bit of a journal or of the store flipped before `resume`.
    Flip,
    /// As a flip, a page zeroed.
    PageZeroed,
    /// As a flip, the store cut short.
    StoreCut,
    /// As a flip, the store deleted.
    StoreLost,
}

impl FaultKind {
    /// All kinds with their names.
    pub const ALL: [(&'static str, FaultKind); 16] = [
        ("kill", FaultKind::Kill),
        ("stop", FaultKind::Stop),
        ("slow", FaultKind::Slow),
        ("sleep", FaultKind::Sleep),
        ("segv", FaultKind::Segv),
        ("abort", FaultKind::Abort),
        ("memory", FaultKind::Memory),
        ("full", FaultKind::Full),
        ("drop", FaultKind::Drop),
        ("corrupt", FaultKind::Corrupt),
        ("index-jump", FaultKind::IndexJump),
        ("sync-fails", FaultKind::SyncFails),
        ("flip", FaultKind::Flip),
        ("page-zeroed", FaultKind::PageZeroed),
        ("store-cut", FaultKind::StoreCut),
        ("store-lost", FaultKind::StoreLost),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, kind)| *kind == self).map_or("", |(name, _)| name)
    }

    /// Whether the supervisor takes the death for the stage's own doing; three of them on one
    /// frame would rightly end the run.
    pub fn is_own_death(self) -> bool {
        matches!(self, Self::Segv | Self::Abort | Self::Memory | Self::Full)
    }

    /// Whether it reaches into a stage and is planned before the run begins.
    pub fn is_planned(self) -> bool {
        matches!(self, Self::Drop | Self::Corrupt | Self::IndexJump | Self::SyncFails)
    }

    /// Whether a file of the run is damaged while no process runs.
    pub fn is_damage(self) -> bool {
        matches!(self, Self::Flip | Self::PageZeroed | Self::StoreCut | Self::StoreLost)
    }
}

/// Who is struck.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultTarget {
    /// One stage.
    Stage(Stage),
    /// The supervisor alone: the stages end by themselves, `resume` goes on.
    Supervisor,
    /// Supervisor and stages at once; `resume` goes on.
    Group,
}

impl FaultTarget {
    /// The target of that name.
    pub fn from_name(name: &str) -> Option<FaultTarget> {
        match name {
            "supervisor" => Some(FaultTarget::Supervisor),
            "group" => Some(FaultTarget::Group),
            stage => Stage::from_name(stage).map(FaultTarget::Stage),
        }
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            FaultTarget::Stage(stage) => stage.name(),
            FaultTarget::Supervisor => "supervisor",
            FaultTarget::Group => "group",
        }
    }
}

/// One fault to come.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Strike {
    /// Since the strike before.
    pub after: Duration,
    /// One target, or two at once.
    pub targets: Vec<FaultTarget>,
    /// What strikes them.
    pub kind: FaultKind,
}

/// Choices that a seed repeats.
#[derive(Clone, Debug)]
pub(super) struct Random(SplitMix64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(SplitMix64::new(seed))
    }

    /// A number below `n`.
    pub(super) fn below(&mut self, n: u64) -> u64 {
        self.0.next_u64() % n.max(1)
    }

    /// In an order of their own.
    pub(super) fn shuffle<T>(&mut self, items: &mut [T]) {
        for n in (1..items.len()).rev() {
            items.swap(n, self.below(n as u64 + 1) as usize);
        }
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> Option<T> {
        from.get(self.below(from.len() as u64) as usize).copied()
    }
}

/// An endless row of faults.
#[derive(Clone, Debug)]
pub(super) struct FaultSchedule {
    random: Random,
    targets: Vec<FaultTarget>,
    kinds: Vec<FaultKind>,
    mean_ms: u64,
}

impl FaultSchedule {
    /// Faults of these kinds on these targets, `mean_ms` apart on average. Kinds that are planned
    /// before a run are left out here.
    pub(super) fn new(seed: u64, targets: &[FaultTarget], kinds: &[FaultKind], mean_ms: u64) -> Self {
        let kinds = kinds.iter().copied().filter(|kind| !kind.is_planned()).collect();
        Self { random: Random::new(seed), targets: targets.to_vec(), kinds, mean_ms }
    }

    /// The next fault; `None` where all kinds are planned ones.
    pub(super) fn next_strike(&mut self) -> Option<Strike> {
        let kind = self.random.pick(&self.kinds)?;
        // One life in eight is cut in its first moments.
        let after = match self.random.below(8) {
            0 => self.random.below(50),
            _ => 20 + self.random.below(2 * self.mean_ms),
        };
        let mut targets: Vec<FaultTarget> = self.random.pick(&self.targets).into_iter().collect();
        if kind.is_damage() || kind == FaultKind::Sleep {
            targets = vec![FaultTarget::Group];
        }
        // One in eight strikes two stages at once.
        if self.random.below(8) == 0
            && let Some(second @ FaultTarget::Stage(_)) = self.random.pick(&self.targets)
            && matches!(targets[..], [FaultTarget::Stage(first)] if FaultTarget::Stage(first) != second)
        {
            targets.push(second);
        }
        Some(Strike { after: Duration::from_millis(after), targets, kind })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(seed: u64) -> Vec<Strike> {
        let targets = [Stage::Sensor, Stage::Align, Stage::Optimise].map(FaultTarget::Stage);
        let mut schedule = FaultSchedule::new(seed, &targets, &[FaultKind::Kill, FaultKind::Stop], 200);
        (0..800).filter_map(|_| schedule.next_strike()).collect()
    }

    #[test]
    fn a_seed_gives_one_schedule_and_another_seed_another() {
        assert_eq!(draw(7), draw(7));
        assert_ne!(draw(7), draw(8));
    }

    #[test]
    fn everybody_is_struck_sometimes_two_at_once() {
        let strikes = draw(1);
        for (kind, stage) in [(FaultKind::Kill, Stage::Align), (FaultKind::Stop, Stage::Sensor)] {
            assert!(strikes.iter().any(|s| s.kind == kind && s.targets == [FaultTarget::Stage(stage)]));
        }
        let pairs = strikes.iter().filter(|s| s.targets.len() == 2).count();
        assert!((20..200).contains(&pairs), "{pairs}");
        assert!(strikes.iter().all(|s| s.targets.len() < 2 || s.targets[0] != s.targets[1]));
        let mean = strikes.iter().map(|s| s.after.as_millis()).sum::<u128>() / 800;
        assert!((150..260).contains(&mean), "{mean}");
    }

    #[test]
    fn kinds_that_are_planned_are_not_drawn() {
        let only = [FaultKind::Drop, FaultKind::Corrupt];
        assert_eq!(FaultSchedule::new(1, &[FaultTarget::Group], &only, 100).next_strike(), None);
        let mut flips = FaultSchedule::new(1, &[FaultTarget::Stage(Stage::Align)], &[FaultKind::Flip], 100);
        assert_eq!(flips.next_strike().unwrap().targets, [FaultTarget::Group]);
        let mut sleeps = FaultSchedule::new(1, &[FaultTarget::Supervisor], &[FaultKind::Sleep], 100);
        assert_eq!(sleeps.next_strike().unwrap().targets, [FaultTarget::Group]);
    }
}
