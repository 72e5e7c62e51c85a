//! Noticing that a process stood still: with a laptop that slept or a container that was paused. In that
//! time no other process could be heard, so that none was silent.

use crate::clock::monotonic_nanos;

/// Looks follow each other within this, nanoseconds, even on a machine that is busy.
const BETWEEN_LOOKS: u64 = 1_000_000_000;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_longer_than_between_two_looks_is_a_standstill() {
        let mut standstill = Standstill { looked_at: 5_000 };
        assert_eq!(standstill.look_at(900_000_000), 0);
        assert_eq!(standstill.look_at(1_000_000_000), 0);
        assert_eq!(standstill.look_at(61_000_000_000), 60_000_000_000);
        assert_eq!(standstill.look_at(61_100_000_000), 0);
    }
}
