//! When a live run puts less work into its frames, and when more again: pure, so that it is tested.

use tessera_surface::Effort;

/// Frames under pressure before effort is lowered by a rung; frames without undo them one by one.
const PATIENCE: u32 = 4;
/// Frames without pressure before it is raised by a rung.
const CALM: u32 = 20;
/// Most that a raise that did not last makes the next one wait, in frames.
const MOST_CALM: u32 = 16 * CALM;

/// What there is to say about the pace when a frame is taken up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    /// Frames left out before it, wherever that was.
    pub(crate) n_left_out: u64,
    /// Whether the aligner had to wait for it.
    pub(crate) has_waited: bool,
}

/// The aligner's place on the ladder.
#[derive(Debug)]
pub(crate) struct Ladder {
    effort: Effort,
    pressure: u32,
    calm: u32,
    calm_needed: u32,
    /// Frames since the last raise.
    since_raise: u32,
}

impl Ladder {
    /// Goes on at the effort of the last frame.
    pub(crate) fn begin(effort: Effort) -> Self {
        Self { effort, pressure: 0, calm: 0, calm_needed: CALM, since_raise: u32::MAX }
    }

    /// What new frames get.
    pub(crate) fn effort(&self) -> Effort {
        self.effort
    }

    /// Takes a frame in; `true` where the effort changes.
    pub(crate) fn note(&mut self, pace: &Pace) -> bool {
        let before = self.effort;
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
        self.effort != before
    }

    fn lower(&mut self) {
        (self.pressure, self.calm) = (0, 0);
        // The last raise was too early: the next one takes its time.
        if self.since_raise <= 2 * CALM {
            self.calm_needed = (2 * self.calm_needed).min(MOST_CALM);
            self.since_raise = u32::MAX;
        }
        self.effort = self.effort.lowered();
    }

    fn raise(&mut self) {
        (self.pressure, self.calm) = (0, 0);
        if self.effort == Effort::Full {
            self.calm_needed = CALM;
            return;
        }
        self.since_raise = 0;
        self.effort = self.effort.raised();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EASY: Pace = Pace { n_left_out: 0, has_waited: true };
    const BUSY: Pace = Pace { n_left_out: 0, has_waited: false };
    const DROPPED: Pace = Pace { n_left_out: 2, has_waited: true };

    /// Frames until the effort changes.
    fn until_change(ladder: &mut Ladder, pace: &Pace) -> Option<u32> {
        (1..=2 * MOST_CALM).find(|_| ladder.note(pace))
    }

    #[test]
    fn it_goes_down_under_pressure_and_comes_back_by_itself() {
        let mut ladder = Ladder::begin(Effort::Full);
        for (pace, expected) in
            [(BUSY, Effort::FewerPoints), (DROPPED, Effort::SmallWindow), (BUSY, Effort::Least)]
        {
            assert_eq!(until_change(&mut ladder, &pace), Some(PATIENCE));
            assert_eq!(ladder.effort(), expected);
        }
        assert_eq!(until_change(&mut ladder, &DROPPED), None, "there is no rung below");
        for expected in [Effort::SmallWindow, Effort::FewerPoints, Effort::Full] {
            assert_eq!(until_change(&mut ladder, &EASY), Some(CALM));
            assert_eq!(ladder.effort(), expected);
        }
        assert_eq!(until_change(&mut ladder, &EASY), None);
    }

    #[test]
    fn a_busy_frame_now_and_then_is_no_overload() {
        let mut ladder = Ladder::begin(Effort::Full);
        assert!((0..1000).all(|k| !ladder.note(if k % 3 == 0 { &DROPPED } else { &EASY })));
        assert_eq!(ladder.effort(), Effort::Full);
    }

    #[test]
    fn a_raise_that_does_not_last_is_tried_less_and_less_often() {
        let mut ladder = Ladder::begin(Effort::FewerPoints);
        let mut waits = Vec::new();
        for _ in 0..3 {
            waits.extend(until_change(&mut ladder, &EASY));
            assert_eq!(until_change(&mut ladder, &BUSY), Some(PATIENCE));
        }
        assert_eq!(waits, [CALM, 2 * CALM, 4 * CALM]);
    }
}
