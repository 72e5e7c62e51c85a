//! What came of the faults: a table for people, JSON lines for scripts.

use super::relay::CarriedBytes;
use super::schedule::{FleetFault, FleetStrike};
use crate::error::FleetError;
use crate::wire::request::PieceRefusal;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

/// One robot of a campaign.
#[derive(Clone, Debug, Serialize)]
pub struct RobotReport {
    /// Its name.
    pub robot: String,
    /// Its run.
    pub run: PathBuf,
    /// Bytes of journals and store in it.
    pub run_bytes: u64,
    /// What its relay carried.
    #[serde(flatten)]
    pub carried: CarriedBytes,
    /// Whether its copy is the run, byte for byte.
    pub identical: bool,
}

/// A campaign.
#[derive(Clone, Debug, Default)]
pub struct FleetReport {
    /// Seed of the faults.
    pub seed: u64,
    /// Faults that struck.
    pub strikes: Vec<FleetStrike>,
    /// Robots in the order in which they came.
    pub robots: Vec<RobotReport>,
    /// Pieces that the base refused, as far as its status showed them before it was killed.
    pub refused: BTreeMap<PieceRefusal, u64>,
    /// From the first fault until the base had everything and its map, seconds.
    pub wall_s: f64,
    /// From the last fault until the base had everything, seconds.
    pub catch_up_s: f64,
    /// Files of the map.
    pub map_files: usize,
    /// Whether they have the bytes of the undisturbed base's.
    pub is_map_identical: bool,
    /// Everything that the promise forbids and that happened.
    pub broken: Vec<String>,
    /// Where everything is kept, where it is.
    pub kept_in: Option<PathBuf>,
}

impl FleetReport {
    fn sum(&self, of: impl Fn(&RobotReport) -> u64) -> u64 {
        self.robots.iter().map(of).sum()
    }

    fn n_struck(&self, fault: FleetFault) -> usize {
        self.strikes.iter().filter(|strike| strike.fault == fault).count()
    }

    /// Fails where the promise was broken.
    ///
    /// # Errors
    /// Says what differs, and where everything is kept.
    pub fn verdict(&self) -> Result<(), FleetError> {
        if self.broken.is_empty() {
            return Ok(());
        }
        let broken = FleetError::Broken(self.broken.join("; "));
        Err(match &self.kept_in {
            Some(folder) => broken.kept(folder),
            None => broken,
        })
    }

    /// One line for each fault, each robot, and the total.
    pub fn to_json_lines(&self) -> String {
        let line = |event: &str, mut value: serde_json::Value| {
            value["event"] = event.into();
            value.to_string()
        };
        let value = |what: &dyn Fn() -> serde_json::Result<serde_json::Value>| what().unwrap_or_default();
        let faults = self.strikes.iter().map(|strike| {
            let mut fault = value(&|| serde_json::to_value(strike));
            let robot = self.robots.get(strike.robot).filter(|_| strike.fault != FleetFault::KillBase);
            fault["robot"] = robot.map(|robot| robot.robot.as_str()).into();
            line("fault", fault)
        });
        let robots = self.robots.iter().map(|robot| line("robot", value(&|| serde_json::to_value(robot))));
        let mut lines: Vec<String> = faults.chain(robots).collect();
        lines.push(line(
            "total",
            serde_json::json!({
                "seed": self.seed,
                "faults": self.strikes.len(),
                "kept": self.broken.is_empty(),
                "refused": value(&|| serde_json::to_value(&self.refused)),
                "wall_s": self.wall_s,
                "catch_up_s": self.catch_up_s,
                "map_files": self.map_files,
                "map_identical": self.is_map_identical,
                "broken": self.broken,
            }),
        ));
        lines.join("\n")
    }

    /// A table of at most 80 columns.
    pub fn for_people(&self) -> String {
        let n_robots = self.robots.len();
        let mut text = format!(
            "fleet of {n_robots} robots, seed {}: {} faults in {:.0} s\n",
            self.seed,
            self.strikes.len(),
            self.wall_s
        );
        // Writing to a String cannot fail, here and below.
        for (fault, words) in FleetFault::ALL {
            let _ = writeln!(text, "  {words:<30}{:>6}", self.n_struck(fault));
        }
        let mb = |bytes: u64| bytes as f64 / 1e6;
        let _ = writeln!(
            text,
            "  bytes       {:.1} MB in the runs, {:.1} MB carried over {} connections",
            mb(self.sum(|r| r.run_bytes)),
            mb(self.sum(|r| r.carried.up_bytes)),
            self.sum(|r| r.carried.connections)
        );
        let _ = writeln!(
            text,
            "  twice       {:.1} kB, which the relays sent to the base once more",
            self.sum(|r| r.carried.repeated_bytes) as f64 / 1e3
        );
        let refused: Vec<String> =
            self.refused.iter().map(|(what, n)| format!("{n} x {}", what.words())).collect();
        let refused = if refused.is_empty() { "no piece".to_owned() } else { refused.join(", ") };
        let _ = writeln!(text, "  refused     {refused}");
        let _ = writeln!(text, "  caught up   {:.1} s after the last fault", self.catch_up_s);
        let n_identical = self.robots.iter().filter(|robot| robot.identical).count();
        let _ = writeln!(text, "  copies      identical to the run of {n_identical} of {n_robots} robots");
        let words = if self.is_map_identical { "identical to" } else { "NOT those of" };
        let _ = writeln!(text, "  map         {} files, {words} the undisturbed base's", self.map_files);
        let verdict = if self.broken.is_empty() { "kept" } else { "BROKEN" };
        let _ = writeln!(text, "  promise     {verdict}");
        text
    }
}
