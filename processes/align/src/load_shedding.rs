//! Load shedding: when a live run lowers the workload per frame, and when it raises it again. Pure, so
//! that it is tested.

use tessera_surface::WorkloadLevel;

/// Frames under pressure before the workload is lowered by a level; calm frames undo them one by one.
const PATIENCE: u32 = 4;
/// Frames without pressure before it is raised by a level.
const CALM: u32 = 20;
/// Longest wait for the next raise after one that did not last, frames.
const MOST_CALM: u32 = 16 * CALM;

/// The pace at the moment when a frame is taken up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FramePace {
    /// Frames left out before it, wherever that was.
    pub(crate) n_left_out: u64,
    /// Whether the aligner had to wait for it.
    pub(crate) has_waited: bool,
}

/// State of load shedding.
#[derive(Debug)]
pub(crate) struct LoadShedding {
    workload: WorkloadLevel,
    pressure: u32,
    calm: u32,
    calm_needed: u32,
    /// Frames since the last raise.
    since_raise: u32,
}

impl LoadShedding {
    /// Goes on at the workload of the last frame.
    pub(crate) fn begin(workload: WorkloadLevel) -> Self {
        Self { workload, pressure: 0, calm: 0, calm_needed: CALM, since_raise: u32::MAX }
    }

    /// What new frames get.
    pub(crate) fn workload(&self) -> WorkloadLevel {
        self.workload
    }

    /// Takes a frame in; `true` where the workload changes.
    pub(crate) fn note(&mut self, pace: &FramePace) -> bool {
        let before = self.workload;
        self.since_raise = self.since_raise.saturating_add(1);
        if pace.n_left_out > 0 || !pace.has_waited {
            self.calm /= 2;
            self.pressure += 1;
            if self.pressure >= PATIENCE {
                self.lower();
            }
        } else {
            self.pressure = self.pressure.saturating_sub(1);
            self.calm += 1;
            if self.calm >= self.calm_needed {
                self.raise();
            }
        }
        self.workload != before
    }

    fn lower(&mut self) {
        (self.pressure, self.calm) = (0, 0);
        // The last raise was too early: the next one takes its time.
        if self.since_raise <= 2 * CALM {
            self.calm_needed = (2 * self.calm_needed).min(MOST_CALM);
            self.since_raise = u32::MAX;
        }
        self.workload = self.workload.lowered();
    }

    fn raise(&mut self) {
        (self.pressure, self.calm) = (0, 0);
        if self.workload == WorkloadLevel::Full {
            self.calm_needed = CALM;
            return;
        }
        self.since_raise = 0;
        self.workload = self.workload.raised();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EASY: FramePace = FramePace { n_left_out: 0, has_waited: true };
    const BUSY: FramePace = FramePace { n_left_out: 0, has_waited: false };
    const DROPPED: FramePace = FramePace { n_left_out: 2, has_waited: true };

    /// Frames until the workload changes.
    fn until_change(shedding: &mut LoadShedding, pace: &FramePace) -> Option<u32> {
        (1..=2 * MOST_CALM).find(|_| shedding.note(pace))
    }

    #[test]
    fn it_goes_down_under_pressure_and_comes_back_by_itself() {
        let mut shedding = LoadShedding::begin(WorkloadLevel::Full);
        for (pace, expected) in [
            (BUSY, WorkloadLevel::FewerPoints),
            (DROPPED, WorkloadLevel::SmallWindow),
            (BUSY, WorkloadLevel::Least),
        ] {
            assert_eq!(until_change(&mut shedding, &pace), Some(PATIENCE));
            assert_eq!(shedding.workload(), expected);
        }
        assert_eq!(until_change(&mut shedding, &DROPPED), None, "there is no level below");
        for expected in [WorkloadLevel::SmallWindow, WorkloadLevel::FewerPoints, WorkloadLevel::Full] {
            assert_eq!(until_change(&mut shedding, &EASY), Some(CALM));
            assert_eq!(shedding.workload(), expected);
        }
        assert_eq!(until_change(&mut shedding, &EASY), None);
    }

    #[test]
    fn a_busy_frame_now_and_then_is_no_overload() {
        let mut shedding = LoadShedding::begin(WorkloadLevel::Full);
        assert!((0..1000).all(|k| !shedding.note(if k % 3 == 0 { &DROPPED } else { &EASY })));
        assert_eq!(shedding.workload(), WorkloadLevel::Full);
    }

    #[test]
    fn a_raise_that_does_not_last_is_tried_less_and_less_often() {
        let mut shedding = LoadShedding::begin(WorkloadLevel::FewerPoints);
        let mut waits = Vec::new();
        for _ in 0..3 {
            waits.extend(until_change(&mut shedding, &EASY));
            assert_eq!(until_change(&mut shedding, &BUSY), Some(PATIENCE));
        }
        assert_eq!(waits, [CALM, 2 * CALM, 4 * CALM]);
    }
}
