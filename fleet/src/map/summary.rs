//! `map/summary.json`: what the one map is made of, and which joins hold it together. Nothing in it
//! depends on time.

use crate::error::FleetError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;
use tessera_outputs::write_file;
use tessera_slam::{LoopRecord, LoopVerdict};

/// Its name.
pub const SUMMARY_FILE: &str = "summary.json";

/// What the map is. Field names are an interface: scripts read them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct JointSummary {
    /// Version of the program that wrote it.
    pub version: String,
    /// Runs in the order in which they came.
    pub runs: Vec<RunSummary>,
    /// Maps of their own, the largest first: one, where all runs hang together.
    pub components: Vec<ComponentSummary>,
    /// Joins in the order in which they were found.
    pub joins: Vec<JoinSummary>,
    /// Pairs of keyframes of different runs that were tested as loops.
    pub loops_between_runs: u64,
    /// Those of them that hold.
    pub loops_between_runs_closed: u64,
}

/// One run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct RunSummary {
    /// Its robot.
    pub robot: String,
    /// Its name there.
    pub run: String,
    /// What its files and the joins call it.
    pub label: String,
    /// Its keyframes.
    pub keyframes: u64,
    /// Its processed frames.
    pub frames: u64,
    /// Those whose pose is a prediction.
    pub frames_untracked: u64,
    /// Whether its source was exhausted.
    pub is_ended: bool,
    /// Its frames in each component.
    pub frames_by_component: BTreeMap<u32, u64>,
    /// Why it is not in the map, where it is not.
    pub left_out: Option<String>,
}

/// What hangs together.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ComponentSummary {
    /// Its name: the first submap in it.
    pub component: u32,
    /// Its keyframes.
    pub keyframes: u64,
    /// Its cloud.
    pub map: String,
    /// Runs with frames in it.
    pub runs: Vec<String>,
}

/// A join.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JoinSummary {
    /// The run that saw a place of another one.
    pub run: String,
    /// The other one.
    pub with: String,
    /// Keyframe of the first, as the joint map counts.
    pub keyframe: u32,
    /// Keyframe of the other.
    pub with_keyframe: u32,
    /// The component that both are in, where the join holds.
    #[serde(default)]
    pub component: Option<u32>,
    /// Where the first keyframe stands in the axes of its component, metres.
    #[serde(default)]
    pub at_m: Option<[f64; 3]>,
    /// The same of the other.
    #[serde(default)]
    pub with_at_m: Option<[f64; 3]>,
    /// Keyframes that say so.
    pub keyframes_agree: u32,
    /// Smaller share of queries with a match, of both directions.
    pub overlap: f64,
    /// Larger share of the queries in view that float in front of what the other saw.
    pub in_front: f64,
    /// What the optimisation says of it.
    pub verdict: JoinVerdict,
}

/// What became of a join.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JoinVerdict {
    /// Loops hold both together.
    Held,
    /// No loop between them kept its weight: they are apart again.
    Refuted,
}

impl JoinVerdict {
    /// In words.
    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Held => "holds",
            Self::Refuted => "refuted by the optimisation",
        }
    }
}

impl JointSummary {
    pub(crate) fn new(
        runs: Vec<RunSummary>,
        components: Vec<ComponentSummary>,
        joins: Vec<JoinSummary>,
        between: Vec<LoopRecord>,
    ) -> Self {
        let is_closed = |l: &&LoopRecord| l.verdict == LoopVerdict::Accepted && l.weight >= 0.5;
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            runs,
            components,
            joins,
            loops_between_runs: between.len() as u64,
            loops_between_runs_closed: between.iter().filter(is_closed).count() as u64,
        }
    }

    pub(crate) fn empty(runs: Vec<RunSummary>) -> Self {
        Self::new(runs, Vec::new(), Vec::new(), Vec::new())
    }

    pub(crate) fn write(&self, folder: &Path) -> Result<(), FleetError> {
        let text = serde_json::to_string_pretty(self)?;
        write_file(&folder.join(SUMMARY_FILE), |writer| writeln!(writer, "{text}"))?;
        Ok(())
    }

    /// The summary in a map's folder; `None` where there is none.
    pub fn read(folder: &Path) -> Option<Self> {
        serde_json::from_str(&std::fs::read_to_string(folder.join(SUMMARY_FILE)).ok()?).ok()
    }
}
