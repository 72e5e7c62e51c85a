//! What happens, in words and numbers: a line at most once in five seconds for each kind, and counts
//! for the diagnostics.

use crate::carrier::Subscription;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// Time between two lines of one kind.
const INTERVAL: Duration = Duration::from_secs(5);

/// Kinds of what is counted; their words are keys of the diagnostics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ReportEvent {
    /// A message that is none of its type.
    Malformed,
    /// An image of another size or encoding, or one that is not what it says.
    Unusable,
    /// An image that came before the camera was known.
    Before,
    /// An image while no CameraInfo has come.
    NoCamera,
    /// A CameraInfo other than the first.
    CameraChanged,
    /// An image left out because of its CameraInfo.
    OtherCamera,
    /// A clock that jumped back.
    ClockJump,
    /// An image not later than the one before it.
    OutOfOrder,
    /// A depth image without colour.
    WithoutColour,
    /// An image for which there was no room.
    NotSent,
    /// An image that was answered without a pose.
    Late,
    /// What the network refused to carry.
    Carrier,
    /// What others have and cannot be joined.
    Unmatched,
    /// A gyroscope that cannot be used.
    Imu,
    /// A run directory that cannot be read.
    Map,
    /// Time is that of `/clock`, and none has come.
    NoClock,
}

impl ReportEvent {
    /// Key of the diagnostics.
    pub(crate) fn key(self) -> &'static str {
        match self {
            Self::Malformed => "malformed messages",
            Self::Unusable => "unusable images",
            Self::Before => "images before the camera was known",
            Self::NoCamera => "images without CameraInfo",
            Self::CameraChanged => "changes of the camera",
            Self::OtherCamera => "images of another camera",
            Self::ClockJump => "jumps of the clock",
            Self::OutOfOrder => "images out of order",
            Self::WithoutColour => "images without colour",
            Self::NotSent => "images not sent",
            Self::Late => "images answered without a pose",
            Self::Carrier => "network errors",
            Self::Unmatched => "not matched",
            Self::Imu => "gyroscope left out",
            Self::Map => "map not read",
            Self::NoClock => "without a clock",
        }
    }
}

/// Counts, and when each was told last.
#[derive(Debug, Default)]
pub(crate) struct Report {
    counts: BTreeMap<ReportEvent, EventCount>,
    is_quiet: bool,
}

#[derive(Debug, Default)]
struct EventCount {
    total: u64,
    untold: u64,
    told_at: Option<Instant>,
}

impl Report {
    pub(crate) fn new(is_quiet: bool) -> Self {
        Self { is_quiet, ..Self::default() }
    }

    /// Tells something that happens now and then.
    pub(crate) fn say(&self, words: &str) {
        if !self.is_quiet {
            eprintln!("tessera-ros2: {words}");
        }
    }

    /// Counts, and tells it unless that was done shortly before.
    pub(crate) fn note(&mut self, event: ReportEvent, words: impl FnOnce() -> String) {
        if let Some(line) = self.line(event, Instant::now(), words) {
            self.say(&line);
        }
    }

    /// Counts without words.
    pub(crate) fn count(&mut self, event: ReportEvent) {
        self.add(event, 1);
    }

    /// Counts several at once, without words.
    pub(crate) fn add(&mut self, event: ReportEvent, n: u64) {
        let count = self.counts.entry(event).or_default();
        count.total = count.total.saturating_add(n);
    }

    fn line(&mut self, event: ReportEvent, now: Instant, words: impl FnOnce() -> String) -> Option<String> {
        let count = self.counts.entry(event).or_default();
        count.total = count.total.saturating_add(1);
        count.untold = count.untold.saturating_add(1);
        if count.told_at.is_some_and(|told| now.saturating_duration_since(told) < INTERVAL) {
            return None;
        }
        let more = match count.untold {
            1 => String::new(),
            n => format!(" ({n} since the last such line)"),
        };
        (count.told_at, count.untold) = (Some(now), 0);
        Some(words() + &more)
    }

    /// All counts that are not zero.
    pub(crate) fn totals(&self) -> impl Iterator<Item = (ReportEvent, u64)> {
        self.counts.iter().map(|(event, count)| (*event, count.total))
    }
}

/// The next message; an error of the network is told and counted.
pub(crate) fn take(from: &mut dyn Subscription, report: &mut Report) -> Option<Vec<u8>> {
    match from.take() {
        Ok(message) => message,
        Err(error) => {
            report.note(ReportEvent::Carrier, || error.to_string());
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_told_once_in_a_while_and_counted_always() {
        let (mut report, now) = (Report::new(true), Instant::now());
        let mut line = |event, seconds| {
            report.line(event, now + Duration::from_secs(seconds), || "it is bad".to_owned())
        };
        assert_eq!(line(ReportEvent::Malformed, 0).as_deref(), Some("it is bad"));
        assert_eq!(line(ReportEvent::Malformed, 1), None);
        assert_eq!(line(ReportEvent::ClockJump, 1).as_deref(), Some("it is bad"));
        assert_eq!(
            line(ReportEvent::Malformed, 6).as_deref(),
            Some("it is bad (2 since the last such line)")
        );
        report.count(ReportEvent::WithoutColour);
        let totals: Vec<(ReportEvent, u64)> = report.totals().collect();
        assert_eq!(
            totals,
            [(ReportEvent::Malformed, 3), (ReportEvent::ClockJump, 1), (ReportEvent::WithoutColour, 1)]
        );
    }
}
