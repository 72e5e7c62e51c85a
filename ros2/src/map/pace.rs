//! How often what is large or takes long is made again: not more often than a network and a
//! processor that have other work can bear.

use std::time::{Duration, Instant};

/// Bytes a second on average, at most.
const BYTES_PER_S: f64 = 2e6;
/// Time of a processor, at most.
const SHARE: f64 = 0.1;

/// When something may be made again.
#[derive(Debug)]
pub(crate) struct MapPace {
    period: Duration,
    next: Option<Instant>,
}

impl MapPace {
    /// Now, and then after that time at least.
    pub(crate) fn new(period: Duration) -> Self {
        Self { period, next: None }
    }

    /// Whether it may be made now.
    pub(crate) fn is_open(&self, now: Instant) -> bool {
        self.next.is_none_or(|next| now >= next)
    }

    /// Notes that it was made, from when to when, and has so many bytes.
    pub(crate) fn close(&mut self, began: Instant, now: Instant, n_bytes: usize) {
        let took = now.saturating_duration_since(began);
        let wait = self.period.max(Duration::from_secs_f64(n_bytes as f64 / BYTES_PER_S));
        self.next = Some(now + wait.max(took.div_f64(SHARE)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_large_or_takes_long_is_made_less_often() {
        let now = Instant::now();
        let after = |seconds| now + Duration::from_secs(seconds);
        let mut pace = MapPace::new(Duration::from_secs(5));
        assert!(pace.is_open(now));
        pace.close(now, now, 1000);
        assert!(!pace.is_open(after(4)) && pace.is_open(after(5)));
        pace.close(now, now, 40_000_000);
        assert!(!pace.is_open(after(19)) && pace.is_open(after(20)));
        pace.close(now, after(3), 1000);
        assert!(!pace.is_open(after(32)) && pace.is_open(after(33)));
    }
}
