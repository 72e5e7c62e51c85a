//! Recovery time of a stage: from the signal to its successor's first new output, by the stamps
//! of the monotonic clock in the run's log.

use tessera_messages::Stage;
use tessera_stage::{FIRST_OUTPUT, READY, STRUCK};

/// What a line of the log tells of a life.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Sign {
    /// It can work.
    Ready,
    /// It has sent its first new frame, surface or pose.
    Output,
    /// A kill point struck: `point:index:fault`.
    Struck(String),
}

/// A line of the log with a stamp.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ChaosEvent {
    /// Monotonic clock, nanoseconds.
    pub(super) at_nanos: u64,
    /// Which stage.
    pub(super) stage: Stage,
    /// Which life.
    pub(super) pid: u32,
    /// What happened.
    pub(super) sign: Sign,
}

/// A death that was caused on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hit {
    /// When, monotonic clock, nanoseconds.
    pub(super) at_nanos: u64,
    /// Whose.
    pub(super) stage: Stage,
    /// Which life.
    pub(super) pid: u32,
}

/// What became of a stage that was hit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Recovery {
    /// It was back after so many milliseconds.
    After(f64),
    /// It was hit again before it was back: the later hit counts.
    Overtaken,
    /// Nothing more was to be done in this run, or the hit did not end the process.
    Over,
}

/// The stamped lines of a log, in order.
pub(super) fn events(log: &str) -> Vec<ChaosEvent> {
    log.lines().filter_map(event).collect()
}

/// `TIME LEVEL stage[pid] words at_nanos=…`.
fn event(line: &str) -> Option<ChaosEvent> {
    let mut words = line.split_whitespace().skip(2);
    let (name, pid) = words.next()?.split_once('[')?;
    let (_, said) = line.split_once("] ")?;
    let at = said.split_whitespace().find_map(|word| word.strip_prefix("at_nanos="))?;
    let sign = if said.starts_with(FIRST_OUTPUT) {
        Sign::Output
    } else if said.starts_with(READY) {
        Sign::Ready
    } else {
        Sign::Struck(said.strip_prefix(STRUCK)?.split_whitespace().next()?.to_owned())
    };
    Some(ChaosEvent {
        at_nanos: at.parse().ok()?,
        stage: Stage::from_name(name)?,
        pid: pid.trim_end_matches(']').parse().ok()?,
        sign,
    })
}

/// How long the stage of `hit` was away, given all hits and the log's events.
pub(super) fn recovery(hit: &Hit, hits: &[Hit], events: &[ChaosEvent]) -> Recovery {
    // The optimiser has nothing to put out unless it is asked.
    let wanted = if hit.stage == Stage::Optimise { Sign::Ready } else { Sign::Output };
    let later = |event: &&ChaosEvent| {
        event.stage == hit.stage
            && event.pid != hit.pid
            && event.at_nanos > hit.at_nanos
            && event.sign == wanted
    };
    let back = events.iter().filter(later).map(|event| event.at_nanos).min();
    let is_overtaken = hits.iter().any(|other| {
        other.stage == hit.stage
            && other.at_nanos > hit.at_nanos
            && back.is_none_or(|back| other.at_nanos < back)
    });
    match back {
        _ if is_overtaken => Recovery::Overtaken,
        Some(back) => Recovery::After(back.saturating_sub(hit.at_nanos) as f64 * 1e-6),
        None => Recovery::Over,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOG: &str = "\
2026-11-21T11:18:12.3Z  INFO supervisor[1] run x in /x
2026-11-21T11:18:12.3Z  INFO align[10] ready at_nanos=1000000 frame=0
2026-11-21T11:18:12.3Z  INFO align[10] first output at_nanos=2000000 frame=0
2026-11-21T11:18:12.3Z  WARN align[10] struck by stored:12:kill at_nanos=5000000
2026-11-21T11:18:12.3Z  INFO align[11] ready at_nanos=7000000 frame=12
2026-11-21T11:18:12.3Z  INFO align[12] first output at_nanos=9000000 frame=12
2026-11-21T11:18:12.3Z  INFO optimise[13] ready at_nanos=9500000
";

    #[test]
    fn lines_with_stamps_are_events() {
        let events = events(LOG);
        assert_eq!(events.len(), 6);
        assert_eq!(events[2].sign, Sign::Struck("stored:12:kill".into()));
        assert_eq!((events[4].stage, events[4].pid, events[4].at_nanos), (Stage::Align, 12, 9_000_000));
    }

    #[test]
    fn the_time_runs_from_the_last_hit_to_the_first_output() {
        let events = events(LOG);
        let hit = |at_nanos, stage, pid| Hit { at_nanos, stage, pid };
        let hits = [
            hit(5_000_000, Stage::Align, 10),
            hit(7_500_000, Stage::Align, 11),
            hit(9_000_000, Stage::Optimise, 4),
            hit(9_200_000, Stage::Align, 12),
        ];
        let of = |k: usize| recovery(&hits[k], &hits, &events);
        assert_eq!(
            [of(0), of(1), of(2), of(3)],
            [Recovery::Overtaken, Recovery::After(1.5), Recovery::After(0.5), Recovery::Over]
        );
    }
}
