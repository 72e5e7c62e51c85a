//! Time as nodes of ROS have it: that of the system, or that of `/clock` where it is simulated or a bag is
//! played. Images have times of their own; this one is for what is published now and then.

use crate::carrier::{CLOCK, Carrier, CarrierError, Quality, Subscription};
use crate::report::{Report, ReportEvent, take};
use std::time::{Instant, SystemTime, UNIX_EPOCH};
use tessera_recording::ros::{Time, decode};

const TOPIC: &str = "/clock";
/// Nanoseconds between two messages of path and diagnostics.
const PERIOD_NANOS: i64 = 1_000_000_000;
/// Images older than this have times of another clock, nanoseconds.
const MOST_AGE_NANOS: i64 = 10_000_000_000;

/// The time, and when it was last told what is told every second.
pub(crate) struct RosTime {
    clock: Option<Box<dyn Subscription>>,
    simulated_nanos: Option<i64>,
    told_nanos: Option<i64>,
    began: Instant,
}

impl RosTime {
    /// The system's time, or with `is_simulated` that of `/clock`.
    ///
    /// # Errors
    /// Where the network refuses the topic.
    pub(crate) fn new(carrier: &mut dyn Carrier, is_simulated: bool) -> Result<Self, CarrierError> {
        // As rclcpp reads it.
        let quality = Quality { depth: 1, ..Quality::SENSOR };
        let clock = is_simulated.then(|| carrier.subscribe(TOPIC, CLOCK, quality)).transpose()?;
        Ok(Self { clock, simulated_nanos: None, told_nanos: None, began: Instant::now() })
    }

    /// Takes the newest time of `/clock`.
    pub(crate) fn step(&mut self, report: &mut Report) {
        let Some(clock) = &mut self.clock else { return };
        while let Some(message) = take(&mut **clock, report) {
            match read(&message) {
                Some(nanos) => self.simulated_nanos = Some(nanos),
                None => report.note(ReportEvent::Malformed, || {
                    format!("{TOPIC}: no rosgraph_msgs/msg/Clock: {} bytes", message.len())
                }),
            }
        }
    }

    /// Nanoseconds; `None` while no `/clock` has come.
    pub(crate) fn now_nanos(&self) -> Option<i64> {
        if self.clock.is_some() {
            return self.simulated_nanos;
        }
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Some(i64::try_from(now.as_nanos()).unwrap_or(i64::MAX))
    }

    /// The time by which what is incomplete waits: that of `/clock`, so that nothing is given up while a
    /// bag is played slowly or paused; without it, nanoseconds since the start, which never jump.
    pub(crate) fn waiting_nanos(&self) -> i64 {
        let since = i64::try_from(self.began.elapsed().as_nanos()).unwrap_or(i64::MAX);
        self.simulated_nanos.unwrap_or(since)
    }

    /// The time where another second has gone by since that was last so, or the clock jumped back.
    pub(crate) fn next_second(&mut self) -> Option<i64> {
        let now = self.now_nanos()?;
        let is_due =
            self.told_nanos.is_none_or(|told| !(0..PERIOD_NANOS).contains(&now.saturating_sub(told)));
        if !is_due {
            return None;
        }
        self.told_nanos = Some(now);
        Some(now)
    }

    /// Age of an image by this clock, milliseconds; `None` where its time is that of another clock.
    pub(crate) fn age_ms(&self, stamp_nanos: i64) -> Option<f64> {
        let age = self.now_nanos()?.saturating_sub(stamp_nanos);
        (age.saturating_abs() < MOST_AGE_NANOS).then_some(age as f64 * 1e-6)
    }
}

/// The time in a `rosgraph_msgs/msg/Clock`.
fn read(message: &[u8]) -> Option<i64> {
    decode(CLOCK.name, message).ok().map(|time: Time| time.nanos())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::carrier::Bytes;

    /// Messages that come one by one.
    struct Played(Vec<Bytes>);

    impl Subscription for Played {
        fn take(&mut self) -> Result<Option<Bytes>, CarrierError> {
            Ok(self.0.pop())
        }
    }

    fn simulated(message: Option<Bytes>) -> RosTime {
        let clock: Option<Box<dyn Subscription>> = Some(Box::new(Played(message.into_iter().collect())));
        RosTime { clock, simulated_nanos: None, told_nanos: None, began: Instant::now() }
    }

    fn message(sec: i32, nanosec: u32) -> Bytes {
        [&[0, 1, 0, 0][..], &sec.to_le_bytes(), &nanosec.to_le_bytes()].concat()
    }

    #[test]
    fn simulated_time_is_that_of_the_clock_and_none_before_it_comes() {
        let mut report = Report::new(true);
        let mut time = simulated(None);
        time.step(&mut report);
        assert_eq!((time.now_nanos(), time.next_second(), time.age_ms(5)), (None, None, None));
        assert!((0..1_000_000_000_000).contains(&time.waiting_nanos()));
        let mut time = simulated(Some(message(7, 500_000_000)));
        time.step(&mut report);
        assert_eq!((time.next_second(), time.waiting_nanos()), (Some(7_500_000_000), 7_500_000_000));
        assert_eq!(time.age_ms(7_400_000_000), Some(100.0));
        assert_eq!(time.age_ms(1_700_000_000_000_000_000), None);
        let mut torn = simulated(Some(vec![0, 1, 0, 0, 9]));
        torn.step(&mut report);
        assert_eq!((torn.now_nanos(), report.totals().count()), (None, 1));
        assert_eq!(read(&[0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 3]), Some(2_000_000_003));
    }

    #[test]
    fn a_second_is_one_of_the_clock_and_a_jump_back_begins_anew() {
        let mut time = simulated(None);
        let mut at = |nanos| {
            time.simulated_nanos = Some(nanos);
            time.next_second().is_some()
        };
        assert_eq!([10, 10, 900_000_010, 1_000_000_010].map(&mut at), [true, false, false, true]);
        assert_eq!([500_000_000, 500_000_001, 1_500_000_000].map(&mut at), [true, false, true]);
    }
}
