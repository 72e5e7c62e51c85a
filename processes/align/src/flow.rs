//! Flow control: acknowledging frames and asking for them again. Pure, so that it is tested.

use tessera_messages::Flow;
use tessera_surface::WorkloadLevel;

/// How long a hole in the indices may last before what is missing is asked for again: two
/// publishers, a dying one and its successor, may interleave.
const GRACE_NANOS: u64 = 30_000_000;
/// How long nothing may come before everything is asked for again; doubled when that did not help.
/// Long, for it is the last resort: what died is replaced and goes on by itself.
const PATIENCE_NANOS: u64 = 1_500_000_000;
const MOST_PATIENCE_NANOS: u64 = 12_000_000_000;

/// The aligner's side of the window.
#[derive(Debug)]
pub(crate) struct FlowControl {
    flow: Flow,
    /// When the first missing index last changed.
    progressed_at: u64,
    /// When a message behind the first missing index was first seen in this epoch.
    gap_seen_at: Option<u64>,
    patience: u64,
}

impl FlowControl {
    /// Begins an epoch at the first index that is missing.
    pub(crate) fn begin(first_missing: u64, now: u64) -> Self {
        Self {
            flow: Flow {
                epoch: now,
                resend_from: first_missing,
                acknowledged: first_missing,
                ..Flow::default()
            },
            progressed_at: now,
            gap_seen_at: None,
            patience: PATIENCE_NANOS,
        }
    }

    /// Goes on in a predecessor's epoch: everything below `next` is in hand or durable, and what
    /// was under way still comes.
    pub(crate) fn adopt(epoch: u64, next: u64, now: u64) -> Self {
        Self {
            flow: Flow { epoch, resend_from: next, acknowledged: next, ..Flow::default() },
            ..Self::begin(next, now)
        }
    }

    /// What the sensor should know.
    pub(crate) fn flow(&self) -> Flow {
        self.flow
    }

    /// Everything below is in hand or durable. `true` where the sensor should hear of it.
    pub(crate) fn acknowledge(&mut self, first_missing: u64, now: u64) -> bool {
        if first_missing <= self.flow.acknowledged {
            return false;
        }
        self.flow.acknowledged = first_missing;
        self.progressed_at = now;
        self.gap_seen_at = None;
        self.patience = PATIENCE_NANOS;
        true
    }

    /// How much work new frames get.
    pub(crate) fn set_workload(&mut self, workload: WorkloadLevel) {
        self.flow.workload = workload.level() as u64;
    }

    /// The end is journaled.
    pub(crate) fn finish(&mut self) {
        self.flow.finished = 1;
    }

    /// A message of this index came in this epoch.
    pub(crate) fn saw(&mut self, index: u64, epoch: u64, now: u64) {
        if epoch == self.flow.epoch && index > self.flow.acknowledged && self.gap_seen_at.is_none() {
            self.gap_seen_at = Some(now);
        }
    }

    /// While waiting for the first missing index: raises the epoch where it does not come.
    pub(crate) fn waited(&mut self, now: u64) -> bool {
        let has_gap = self.gap_seen_at.is_some_and(|at| now.saturating_sub(at) >= GRACE_NANOS);
        let is_late = now.saturating_sub(self.progressed_at) >= self.patience;
        if !(has_gap || is_late) {
            return false;
        }
        self.patience = (2 * self.patience).min(MOST_PATIENCE_NANOS);
        self.raise(self.flow.acknowledged, now);
        true
    }

    /// Time in which nothing could come because the aligner itself was busy does not count.
    pub(crate) fn was_busy(&mut self, now: u64) {
        self.progressed_at = self.progressed_at.max(now);
        self.gap_seen_at = self.gap_seen_at.map(|_| now);
    }

    fn raise(&mut self, first_missing: u64, now: u64) {
        let epoch = now.max(self.flow.epoch + 1);
        self.flow =
            Flow { epoch, resend_from: first_missing, acknowledged: first_missing, finished: 0, ..self.flow };
        self.progressed_at = now;
        self.gap_seen_at = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn frames_in_order_never_raise_the_epoch() {
        let mut control = FlowControl::begin(0, 5);
        for index in 0..100 {
            let now = 5 + index * 33 * MS;
            control.saw(index, 5, now);
            assert!(!control.waited(now));
            assert!(control.acknowledge(index + 1, now));
        }
        assert_eq!(control.flow(), Flow { epoch: 5, acknowledged: 100, ..Flow::default() });
    }

    #[test]
    fn a_hole_is_asked_for_again_after_a_moment() {
        let mut control = FlowControl::begin(10, 5);
        control.saw(12, 5, 10 * MS);
        assert!(!control.waited(20 * MS));
        assert!(control.waited(41 * MS));
        let flow = control.flow();
        assert_eq!((flow.resend_from, flow.acknowledged), (10, 10));
        assert!(flow.epoch > 5);
        // What still comes from before says nothing about the new epoch.
        control.saw(13, 5, 42 * MS);
        assert!(!control.waited(90 * MS));
    }

    #[test]
    fn an_epoch_that_was_adopted_is_raised_where_something_is_missing() {
        let mut control = FlowControl::adopt(5, 10, 100 * MS);
        assert_eq!(control.flow(), Flow { epoch: 5, resend_from: 10, acknowledged: 10, ..Flow::default() });
        assert!(!control.waited(120 * MS));
        control.saw(12, 5, 120 * MS);
        assert!(control.waited(151 * MS));
        assert_eq!((control.flow().epoch, control.flow().resend_from), (151 * MS, 10));
    }

    #[test]
    fn silence_is_asked_into_less_and_less_often() {
        let mut control = FlowControl::begin(10, 0);
        let raised: Vec<u64> = (0..20_000).filter(|&ms| control.waited(ms * MS)).collect();
        assert_eq!(raised, [1500, 4500, 10_500]);
        control.acknowledge(11, 20_000 * MS);
        assert!(control.waited(21_500 * MS));
    }
}
