//! Totals of a stage over all its lives, from its beats.

use tessera_messages::{Beat, Latency, TimeCounts};

/// Counters of one stage over all its lives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Lives after the first.
    pub restarts: u64,
    /// Frames (or requests) done.
    pub frames: u64,
    /// Frames left out because newer ones had come (live mode).
    pub dropped: u64,
    /// CPU time, nanoseconds.
    pub cpu_nanos: u64,
    /// Highest resident set, bytes.
    pub peak_rss_bytes: u64,
    /// Time for one frame, of the life that did most frames; the longest of all lives.
    pub latency: Latency,
    /// Time from shared memory to pose, likewise (align).
    pub end_to_end: Latency,
    /// How often one frame took how long.
    pub latency_counts: TimeCounts,
    /// The same from shared memory to pose (align).
    pub end_to_end_counts: TimeCounts,
}

/// One stage's counters, and the beat of its present life.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    past: Counters,
    most_frames: u64,
    /// The newest beat of the present life.
    pub beat: Beat,
}

impl Tally {
    /// Takes a beat of the present life.
    pub(crate) fn take(&mut self, beat: &Beat) {
        self.beat = *beat;
    }

    /// The present life is over.
    pub(crate) fn close_life(&mut self) {
        self.past = self.total();
        self.most_frames = self.most_frames.max(self.beat.frames);
        self.beat = Beat { index: self.beat.index, ..Beat::default() };
    }

    /// A new life begins.
    pub(crate) fn count_restart(&mut self) {
        self.past.restarts = self.past.restarts.saturating_add(1);
    }

    /// All lives together.
    pub(crate) fn total(&self) -> Counters {
        let (past, beat) = (&self.past, &self.beat);
        let is_longest = beat.frames > self.most_frames;
        let merge = |old: Latency, new: Latency| Latency {
            max: old.max.max(new.max),
            ..if is_longest { new } else { old }
        };
        Counters {
            restarts: past.restarts,
            frames: past.frames.saturating_add(beat.frames),
            dropped: past.dropped.saturating_add(beat.dropped),
            cpu_nanos: past.cpu_nanos.saturating_add(beat.cpu_nanos),
            peak_rss_bytes: past.peak_rss_bytes.max(beat.peak_rss_bytes),
            latency: merge(past.latency, beat.latency),
            end_to_end: merge(past.end_to_end, beat.end_to_end),
            latency_counts: past.latency_counts.and(&beat.latency_counts),
            end_to_end_counts: past.end_to_end_counts.and(&beat.end_to_end_counts),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lives_add_up_and_the_longest_gives_the_percentiles() {
        let latency = |p50, max| Latency { p50, p99: p50 + 1, max };
        let life = |frames, p50, max| Beat {
            frames,
            cpu_nanos: frames * 10,
            peak_rss_bytes: 100 - frames,
            latency: latency(p50, max),
            ..Beat::default()
        };
        let mut tally = Tally::default();
        tally.take(&life(3, 5, 50));
        tally.take(&life(50, 7, 70));
        tally.close_life();
        tally.count_restart();
        tally.take(&life(2, 90, 99));
        let total = tally.total();
        assert_eq!((total.frames, total.cpu_nanos, total.restarts), (52, 520, 1));
        assert_eq!((total.peak_rss_bytes, total.latency), (98, latency(7, 99)));
        tally.close_life();
        assert_eq!(tally.total(), total);
    }
}
