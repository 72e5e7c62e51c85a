//! Places where a process dies on purpose, so that each window between two durable steps is hit by
//! a test and not by luck.

use std::collections::BTreeSet;

/// Environment variable that names kill points for one process: `stored:12,journaled:40`.
pub const KILL_POINTS_VARIABLE: &str = "TESSERA_KILL_POINTS";

/// All kill points with the stage that has them; the number is a frame, or a request for the last four.
pub const KILL_POINTS: [(&str, &str); 19] = [
    ("sensor", "opened"),
    ("sensor", "read"),
    ("sensor", "sent"),
    ("reconstruct", "opened"),
    ("reconstruct", "received"),
    ("reconstruct", "computed"),
    ("reconstruct", "sent"),
    ("align", "opened"),
    ("align", "received"),
    ("align", "computed"),
    ("align", "stored"),
    ("align", "journaled"),
    ("align", "published"),
    ("align", "acknowledged"),
    ("align", "ended"),
    ("optimise", "opened"),
    ("optimise", "received"),
    ("optimise", "solving"),
    ("optimise", "journaled"),
];

/// The kill points of this process.
#[derive(Clone, Debug, Default)]
pub struct KillPoints {
    points: BTreeSet<(String, u64)>,
}

impl KillPoints {
    /// Those that the environment names; none where it does not.
    pub fn from_environment() -> Self {
        Self::parse(&std::env::var(KILL_POINTS_VARIABLE).unwrap_or_default())
    }

    fn parse(text: &str) -> Self {
        let points = text.split(',').filter_map(|word| {
            let (point, index) = word.split_once(':')?;
            Some((point.to_string(), index.parse().ok()?))
        });
        Self { points: points.collect() }
    }

    /// Dies here, as by `kill -9`, where a test asked for it.
    pub fn pass(&self, point: &str, index: u64) {
        if !self.points.is_empty() && self.points.contains(&(point.to_string(), index)) {
            let me = rustix::process::getpid();
            let _ = rustix::process::kill_process(me, rustix::process::Signal::KILL);
            // The signal is on its way; nothing more must happen.
            loop {
                std::thread::park();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_named_kills() {
        let points = KillPoints::parse("stored:3,,nonsense,journaled:x");
        assert_eq!(points.points.len(), 1);
        points.pass("stored", 4);
        points.pass("journaled", 3);
    }
}
