//! Which robots were there and what came from them, since the base started.

use crate::base::status::CopyStatus;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Its name in the base's folder.
pub const TRAFFIC_FILE: &str = "traffic.json";

/// Seconds between two looks, at first.
const FIRST_EVERY_S: f64 = 1.0;
/// Looks that are kept: with more, each second one goes and the next ones are twice as far apart.
const MOST_LOOKS: usize = 1000;

/// One look at one robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RobotLook {
    /// Whether it could be asked.
    pub is_connected: bool,
    /// Bytes that had come from it.
    pub received_bytes: u64,
    /// Bytes that it had and the base had not.
    pub lag_bytes: u64,
}

/// Looks at all robots; bounded, however long a base runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Traffic {
    every_s: f64,
    /// Seconds since the base started, rising, and the robots that had come by then.
    looks: Vec<(f64, BTreeMap<String, RobotLook>)>,
}

impl Default for Traffic {
    fn default() -> Self {
        Self { every_s: FIRST_EVERY_S, looks: Vec::new() }
    }
}

impl Traffic {
    /// Takes a look down, so many seconds after the base started, where it is time for one.
    pub fn note(&mut self, at_s: f64, runs: &[CopyStatus]) {
        if self.looks.last().is_some_and(|(last, _)| at_s < last + self.every_s) {
            return;
        }
        let mut robots: BTreeMap<String, RobotLook> = BTreeMap::new();
        for run in runs {
            let robot = robots.entry(run.robot.clone()).or_default();
            robot.is_connected |= run.is_connected;
            robot.received_bytes = robot.received_bytes.saturating_add(run.received_bytes);
            robot.lag_bytes = robot.lag_bytes.saturating_add(run.lag_bytes);
        }
        self.looks.push((at_s, robots));
        if self.looks.len() > MOST_LOOKS {
            let mut is_kept = false;
            self.looks.retain(|_| {
                is_kept = !is_kept;
                is_kept
            });
            self.every_s *= 2.0;
        }
    }

    /// What the base in a folder last wrote; nothing where it has written none, or another version did.
    pub fn read(base: &Path) -> Self {
        let text = std::fs::read_to_string(base.join(TRAFFIC_FILE));
        text.ok().and_then(|text| serde_json::from_str(&text).ok()).unwrap_or_default()
    }

    /// Bytes that came from a robot since the base started.
    pub fn received_bytes(&self, robot: &str) -> u64 {
        let mut looks = self.looks.iter().filter_map(|(_, robots)| robots.get(robot));
        looks.next_back().map_or(0, |look| look.received_bytes)
    }

    /// Seconds of the last look.
    pub fn last_s(&self) -> f64 {
        self.looks.last().map_or(0.0, |(at_s, _)| *at_s)
    }

    /// Bytes a second from a robot at the moments between looks.
    pub fn rates(&self, robot: &str) -> Vec<(f64, f64)> {
        let pairs = self.looks.windows(2).filter_map(|pair| {
            let [(from_s, before), (to_s, after)] = pair else { return None };
            let before = before.get(robot).map_or(0, |look| look.received_bytes);
            let bytes = after.get(robot)?.received_bytes.saturating_sub(before);
            Some((0.5 * (from_s + to_s), bytes as f64 / (to_s - from_s)))
        });
        pairs.collect()
    }

    /// Spans of time in which a robot could be asked, seconds from and to.
    pub fn spans(&self, robot: &str) -> Vec<(f64, f64)> {
        let mut spans: Vec<(f64, f64)> = Vec::new();
        let mut is_open = false;
        for (at_s, robots) in &self.looks {
            let is_connected = robots.get(robot).is_some_and(|look| look.is_connected);
            match spans.last_mut().filter(|_| is_open) {
                Some(span) => span.1 = *at_s,
                None if is_connected => spans.push((*at_s, *at_s)),
                None => {}
            }
            is_open = is_connected;
        }
        spans
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(robot: &str, is_connected: bool, received_bytes: u64) -> CopyStatus {
        CopyStatus { robot: robot.into(), is_connected, received_bytes, ..CopyStatus::default() }
    }

    #[test]
    fn rates_and_spans_follow_from_the_looks() {
        let mut traffic = Traffic::default();
        traffic.note(0.0, &[run("a", true, 0)]);
        traffic.note(0.5, &[run("a", true, 999)]);
        traffic.note(2.0, &[run("a", true, 200), run("a", false, 100), run("b", false, 0)]);
        traffic.note(4.0, &[run("a", false, 300), run("b", true, 50)]);
        traffic.note(5.0, &[run("a", true, 300), run("b", true, 50)]);
        assert_eq!(traffic.rates("a"), [(1.0, 150.0), (3.0, 0.0), (4.5, 0.0)]);
        assert_eq!(traffic.spans("a"), [(0.0, 4.0), (5.0, 5.0)]);
        assert_eq!(traffic.spans("b"), [(4.0, 5.0)]);
        assert_eq!([traffic.received_bytes("a"), traffic.received_bytes("c")], [300, 0]);
        assert!(traffic.rates("c").is_empty() && traffic.spans("c").is_empty());
    }

    #[test]
    fn looks_are_bounded_and_reach_from_the_first_to_the_last() {
        let mut traffic = Traffic::default();
        for second in 0..100_000 {
            traffic.note(f64::from(second), &[run("a", true, u64::from(second as u32))]);
        }
        assert!(traffic.looks.len() <= MOST_LOOKS + 1, "{}", traffic.looks.len());
        assert_eq!(traffic.spans("a")[0].0, 0.0);
        assert!(traffic.last_s() > 99_000.0);
        assert!(traffic.rates("a").iter().all(|(_, rate)| (rate - 1.0).abs() < 1e-9));
    }
}
