//! Times of images as the run has them: they rise, also where the camera's clock jumps back.

/// From this on a time that goes back is a jump of the clock; less is an image out of order.
const JUMP_NANOS: i64 = 500_000_000;
/// Time between the last image before a jump and the first one behind it.
const PERIOD_NANOS: i64 = 33_000_000;
/// Jumps that are remembered.
const MOST_JUMPS: usize = 64;

/// What to do with an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Tick {
    /// Its time in the run.
    At(i64),
    /// The clock jumped back by so many nanoseconds; its time in the run.
    Jumped(i64, i64),
    /// Not later than the image before it: to be left out.
    Late,
}

/// From the camera's clock to that of the run.
#[derive(Debug, Default)]
pub(crate) struct ImageClock {
    /// Newest time in the run.
    last_nanos: Option<i64>,
    /// From when on, in the run, how much later the run's clock is.
    shifts: Vec<(i64, i64)>,
}

impl ImageClock {
    /// The run is this far already.
    pub(crate) fn begin_after(&mut self, run_nanos: i64) {
        self.last_nanos = Some(self.last_nanos.map_or(run_nanos, |last| last.max(run_nanos)));
    }

    /// The time of the next image.
    pub(crate) fn tick(&mut self, stamp_nanos: i64) -> Tick {
        let shift = self.shifts.last().map_or(0, |(_, shift)| *shift);
        let run_nanos = stamp_nanos.saturating_add(shift);
        let Some(last) = self.last_nanos.filter(|last| run_nanos <= *last) else {
            self.last_nanos = Some(run_nanos);
            return Tick::At(run_nanos);
        };
        let back = last.saturating_sub(run_nanos);
        if back < JUMP_NANOS {
            return Tick::Late;
        }
        let next = last.saturating_add(PERIOD_NANOS);
        if self.shifts.len() == MOST_JUMPS {
            self.shifts.remove(0);
        }
        self.shifts.push((next, next.saturating_sub(stamp_nanos)));
        self.last_nanos = Some(next);
        Tick::Jumped(back, next)
    }

    /// The camera's time of an image of the run.
    pub(crate) fn camera_nanos(&self, run_nanos: i64) -> i64 {
        let of = self.shifts.iter().rev().find(|(from, _)| *from <= run_nanos);
        run_nanos.saturating_sub(of.map_or(0, |(_, shift)| *shift))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn times_rise_over_a_jump_and_lead_back() {
        let mut clock = ImageClock::default();
        assert_eq!(clock.tick(9000 * MS), Tick::At(9000 * MS));
        assert_eq!(clock.tick(9033 * MS), Tick::At(9033 * MS));
        assert_eq!((clock.tick(9033 * MS), clock.tick(8990 * MS)), (Tick::Late, Tick::Late));
        assert_eq!(clock.tick(1000 * MS), Tick::Jumped(8033 * MS, 9066 * MS));
        assert_eq!(clock.tick(1040 * MS), Tick::At(9106 * MS));
        assert_eq!(clock.tick(20 * MS), Tick::Jumped(1020 * MS, 9139 * MS));
        for (run, camera) in [(9033, 9033), (9066, 1000), (9106, 1040), (9139, 20)] {
            assert_eq!(clock.camera_nanos(run * MS), camera * MS);
        }
    }

    #[test]
    fn a_program_that_comes_back_goes_on_behind_the_run() {
        let mut clock = ImageClock::default();
        clock.begin_after(5000 * MS);
        assert_eq!(clock.tick(4999 * MS), Tick::Late);
        assert_eq!(clock.tick(1000 * MS), Tick::Jumped(4000 * MS, 5033 * MS));
        clock.begin_after(3000 * MS);
        assert_eq!(clock.tick(1001 * MS), Tick::At(5034 * MS));
    }

    #[test]
    fn times_at_the_ends_of_the_range_do_not_overflow() {
        let mut clock = ImageClock::default();
        assert_eq!(clock.tick(i64::MAX), Tick::At(i64::MAX));
        for stamp in [i64::MIN, i64::MAX, 0, i64::MIN] {
            clock.tick(stamp);
            clock.camera_nanos(stamp);
        }
    }
}
