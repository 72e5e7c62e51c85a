//! Noticing that a process stood still: with a laptop that slept or a container that was paused. In that
//! time no other process could be heard, so that none was silent.

use crate::clock::monotonic_nanos;
use std::time::Duration;

/// Looks follow each other within this, nanoseconds, and within half of `flow.hang_s` at its least: what stands
/// still for longer must not find the others silent for as long as that.
const BETWEEN_LOOKS: u64 = 250_000_000;

/// When this process last looked.
#[derive(Debug)]
pub struct Standstill {
    looked_at: u64,
}

impl Standstill {
    /// From now on.
    pub fn new() -> Self {
        Self { looked_at: monotonic_nanos() }
    }

    /// How long this process stood still since the last look, nanoseconds; 0 where it went on.
    pub fn look(&mut self) -> u64 {
        self.look_at(monotonic_nanos())
    }

    fn look_at(&mut self, now: u64) -> u64 {
        let between = now.saturating_sub(self.looked_at);
        self.looked_at = now;
        if between > BETWEEN_LOOKS { between } else { 0 }
    }
}

impl Default for Standstill {
    fn default() -> Self {
        Self::new()
    }
}

/// The end of a wait in which this process looks again and again; time in which it stood still does not count.
#[derive(Debug)]
pub struct AwakeDeadline {
    at: u64,
    standstill: Standstill,
}

impl AwakeDeadline {
    /// So long from now.
    pub fn after(wait: Duration) -> Self {
        let wait = u64::try_from(wait.as_nanos()).unwrap_or(u64::MAX);
        Self { at: monotonic_nanos().saturating_add(wait), standstill: Standstill::new() }
    }

    /// Whether it has passed.
    pub fn is_over(&mut self) -> bool {
        self.is_over_at(monotonic_nanos())
    }

    fn is_over_at(&mut self, now: u64) -> bool {
        self.at = self.at.saturating_add(self.standstill.look_at(now));
        now >= self.at
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deadline_waits_for_one_that_slept() {
        let looks = |times_ms: &[u64]| {
            let mut deadline = AwakeDeadline { at: 300_000_000, standstill: Standstill { looked_at: 0 } };
            times_ms.iter().map(|ms| deadline.is_over_at(ms * 1_000_000)).collect::<Vec<_>>()
        };
        assert_eq!(looks(&[100, 200, 299, 300]), [false, false, false, true]);
        assert_eq!(looks(&[200, 60_200, 60_299, 60_300]), [false, false, false, true]);
    }

    #[test]
    fn only_what_is_longer_than_between_two_looks_is_a_standstill() {
        let mut standstill = Standstill { looked_at: 5_000 };
        assert_eq!(standstill.look_at(250_000_000), 0);
        assert_eq!(standstill.look_at(500_000_000), 0);
        assert_eq!(standstill.look_at(60_500_000_000), 60_000_000_000);
        assert_eq!(standstill.look_at(60_600_000_000), 0);
    }
}
