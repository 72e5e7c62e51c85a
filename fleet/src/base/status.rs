//! What a base has to show: `status.json` in its folder, written anew each second, and the same in words.

pub use crate::base::answering::AnswerStatus;
use crate::copies::arrivals::FLEET_JOURNAL;
use crate::error::FleetError;
use crate::map::joint::MapCost;
use crate::map::summary::JointSummary;
use crate::wire::request::PieceRefusal;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;
use std::time::Duration;
use tessera_journal::lock_file;

/// Its name in the base's folder.
pub const STATUS_FILE: &str = "status.json";

/// Whether a base holds the journal of a folder.
pub fn is_running(base: &Path) -> bool {
    let path = base.join(FLEET_JOURNAL);
    std::fs::File::open(&path).is_ok_and(|file| lock_file(&file, &path, Duration::ZERO).is_err())
}

/// What a base is doing. Field names are an interface: scripts read them.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// Its process.
    pub pid: u32,
    /// Where it listens; nothing where it only takes runs from disk.
    pub listens: Option<String>,
    /// Runs in the order in which they came.
    pub runs: Vec<CopyStatus>,
    /// What was refused, by robot and by what it was.
    pub refused: Vec<RefusedStatus>,
    /// The map that is made now, if one is.
    pub mapping: Option<u64>,
    /// The last map that was made.
    pub mapped: u64,
    /// Why no map could be made, where that is so.
    pub map_problem: Option<String>,
    /// What that map is.
    pub map: Option<JointSummary>,
    /// What it cost, where this base made it.
    #[serde(default)]
    pub map_cost: Option<MapCost>,
}

/// One run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct CopyStatus {
    /// Its robot.
    pub robot: String,
    /// Its name there.
    pub run: String,
    /// Whether the robot can be asked now.
    pub is_connected: bool,
    /// Whether the run has come to its end and is here whole.
    pub is_ended: bool,
    /// Frames here.
    pub frames: u64,
    /// Keyframes here.
    pub keyframes: u64,
    /// Surfaces of keyframes here.
    #[serde(default)]
    pub surfaces: u64,
    /// Surfaces that the map lacks: of keyframes that the run keeps, the newest come first.
    #[serde(default)]
    pub surfaces_waiting: u64,
    /// Bytes of journals and surfaces here.
    pub bytes: u64,
    /// Bytes that the robot has and the base has not, when it was last asked.
    pub lag_bytes: u64,
    /// Bytes that came since the base started, those of refused pieces included.
    pub received_bytes: u64,
    /// Bytes a second, over the last seconds.
    pub bytes_per_s: f64,
    /// Corrections in it that came from a base.
    #[serde(default)]
    pub corrections_from_base: u64,
    /// The last answer that it took, since the base started.
    #[serde(default)]
    pub answer: Option<AnswerStatus>,
    /// Why its last request could not be answered, where that is so.
    #[serde(default)]
    pub answer_problem: Option<String>,
    /// Why its copy does not go on, where that is so.
    pub problem: Option<String>,
}

/// What was refused of a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RefusedStatus {
    /// The robot, as it calls itself.
    pub robot: String,
    /// What it was.
    pub what: PieceRefusal,
    /// How often.
    pub n: u64,
    /// What was last said of it.
    pub last: String,
}

/// Counts of refusals.
#[derive(Clone, Debug, Default)]
pub struct RefusedCounts(BTreeMap<(String, PieceRefusal), (u64, String)>);

/// Robots whose refusals are counted apart, at most.
const MOST_NAMES: usize = 200;

impl RefusedCounts {
    /// Counts one.
    pub fn count(&mut self, robot: &str, refusal: PieceRefusal, words: &str) {
        let key = |name: &str| (name.to_owned(), refusal);
        let is_room = self.0.len() < MOST_NAMES || self.0.contains_key(&key(robot));
        let entry = self.0.entry(key(if is_room { robot } else { "others" })).or_default();
        entry.0 = entry.0.saturating_add(1);
        if !words.is_empty() {
            entry.1 = words.chars().filter(|c| !c.is_control()).take(200).collect();
        }
    }

    /// All of them, by robot.
    pub fn list(&self) -> Vec<RefusedStatus> {
        let entry = |((robot, what), (n, last)): (&(String, PieceRefusal), &(u64, String))| RefusedStatus {
            robot: robot.clone(),
            what: *what,
            n: *n,
            last: last.clone(),
        };
        self.0.iter().map(entry).collect()
    }
}

impl Status {
    /// What the base in a folder last said.
    ///
    /// # Errors
    /// Where there is none.
    pub fn read(base: &Path) -> Result<Self, FleetError> {
        let path = base.join(STATUS_FILE);
        let wrong = |reason: String| FleetError::Input(format!("{}: {reason}", path.display()));
        let text = std::fs::read_to_string(&path)
            .map_err(|e| wrong(format!("{e}; expected the folder of a base, which writes it")))?;
        serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))
    }

    /// In words, as `tessera base DIR status` prints it.
    pub fn text(&self, is_running: bool) -> String {
        let runs = self.runs.iter().map(|run| format!("  {}\n", run.text(is_running)));
        let runs = runs.collect::<String>();
        format!("{}\n{runs}{}", self.headline(is_running), self.below_runs())
    }

    /// Which base this is, in a line.
    pub fn headline(&self, is_running: bool) -> String {
        let running = if is_running { format!("pid {}", self.pid) } else { "not running".into() };
        let listens = self.listens.as_deref().unwrap_or("no network");
        format!("base: {running}, {listens}")
    }

    /// What was refused, and the map, in words.
    pub fn below_runs(&self) -> String {
        let mut text = String::new();
        let line = |text: &mut String, words: String| {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{words}");
        };
        for refused in &self.refused {
            let last = if refused.last.is_empty() { String::new() } else { format!(" ({})", refused.last) };
            let (robot, what) = (&refused.robot, refused.what.words());
            line(&mut text, format!("  refused of {robot}: {} x {what}{last}", refused.n));
        }
        if let Some(problem) = &self.map_problem {
            line(&mut text, format!("no map: {problem}"));
        }
        match &self.map {
            Some(map) => {
                text.push_str(&map_text(map, self.mapped));
                if let Some(MapCost { all_s, join_s, optimise_s, .. }) = self.map_cost {
                    let words = format!("{all_s:.1} s: places {join_s:.1} s, optimisation {optimise_s:.1} s");
                    line(&mut text, format!("  made in {words}"));
                }
            }
            None => line(&mut text, "map: none yet".into()),
        }
        if let Some(number) = self.mapping {
            line(&mut text, format!("map {number} is being made"));
        }
        text
    }
}

/// What a run is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunState {
    /// It has come to its end and is here whole.
    Ended,
    /// Its robot can be asked.
    GoesOn,
    /// Its robot cannot be asked now.
    Away,
}

impl RunState {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Ended => "ended",
            Self::GoesOn => "goes on",
            Self::Away => "away",
        }
    }
}

impl CopyStatus {
    /// What it is doing, where a base looks at it or no longer does.
    pub fn state(&self, is_running: bool) -> RunState {
        match (self.is_ended, self.is_connected && is_running) {
            (true, _) => RunState::Ended,
            (false, true) => RunState::GoesOn,
            (false, false) => RunState::Away,
        }
    }

    fn text(&self, is_running: bool) -> String {
        let state = match self.state(is_running) {
            RunState::Ended => "ended".into(),
            RunState::GoesOn => {
                format!("{} behind, {}/s", bytes(self.lag_bytes), bytes(rounded(self.bytes_per_s)))
            }
            RunState::Away => format!("away, {} behind", bytes(self.lag_bytes)),
        };
        let corrections = match (self.corrections_from_base, &self.answer) {
            (0, _) => String::new(),
            (n, None) => format!(", {n} correction(s) from here"),
            (n, Some(last)) => {
                format!(", {n} correction(s) from here, the last with {} other run(s)", last.runs)
            }
        };
        let problems = self.answer_problem.iter().chain(&self.problem).map(|problem| format!("; {problem}"));
        let problem: String = problems.collect();
        let waiting = match self.surfaces_waiting {
            0 => String::new(),
            n => format!(" ({n} without a surface yet)"),
        };
        format!(
            "{} {}: {} frames, {} keyframes{waiting}, {}, {state}, {} received{corrections}{problem}",
            self.robot,
            self.run,
            self.frames,
            self.keyframes,
            bytes(self.bytes),
            bytes(self.received_bytes)
        )
    }
}

fn map_text(map: &JointSummary, number: u64) -> String {
    let mut text = format!("map {number}: {} component(s)\n", map.components.len());
    for component in &map.components {
        let (runs, n) = (component.runs.join(", "), component.keyframes);
        let _ = writeln!(text, "  {}: {n} keyframes of {runs}", component.map);
    }
    for join in &map.joins {
        let verdict = join.verdict.words();
        let _ = writeln!(
            text,
            "  {} joined to {}: {verdict}; {} keyframes agree, {:.0} % overlap, {:.1} % in front",
            join.run,
            join.with,
            join.keyframes_agree,
            100.0 * join.overlap,
            100.0 * join.in_front
        );
    }
    for run in map.runs.iter() {
        if let Some(reason) = &run.left_out {
            let _ = writeln!(text, "  {} is left out: {reason}", run.label);
        }
    }
    if map.loops_between_runs > 0 {
        let (closed, found) = (map.loops_between_runs_closed, map.loops_between_runs);
        let _ = writeln!(text, "  loops between runs: {closed} of {found} hold");
    }
    text
}

/// Whole bytes of a rate.
#[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
pub(crate) fn rounded(bytes_per_s: f64) -> u64 {
    bytes_per_s as u64
}

/// Bytes as people read them.
pub fn bytes(n: u64) -> String {
    match n {
        0..1000 => format!("{n} B"),
        1000..1_000_000 => format!("{:.1} kB", n as f64 / 1e3),
        _ => format!("{:.1} MB", n as f64 / 1e6),
    }
}
