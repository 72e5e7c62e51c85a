//! All that a page tells of a run. Positions are metres along right, forward and up.

use crate::picture::ReportPicture;
use crate::scene::ReportScene;
use tessera_outputs::TimelineSample;

/// Whether a frame's pose can be trusted, or why it has none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrameState {
    /// Aligned to the map.
    #[default]
    Tracking,
    /// Not aligned.
    Lost,
    /// Found again, not yet confirmed.
    Relocalising,
    /// Left out (live mode).
    Dropped,
}

/// One frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// As the source counts.
    pub index: u64,
    /// Since the first frame, seconds.
    pub time_s: f64,
    /// Whether it was tracked.
    pub state: FrameState,
    /// Why not, or what there is to say.
    pub reason: String,
    /// Final position; of a dropped frame, that of the frame before.
    pub position_m: [f64; 3],
    /// Distance to the ground truth after alignment of the whole; `None` without one.
    pub error_m: Option<f64>,
    /// Standard deviation of the position as the aligner sees it; `None` where it is unknown.
    pub std_m: Option<f64>,
}

/// One keyframe.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Keyframe {
    /// Its number.
    pub id: u32,
    /// Final position.
    pub position_m: [f64; 3],
    /// Whether an earlier run made it.
    pub is_of_map: bool,
    /// The submap that it belongs to, where that is apart from the main map and stands beside it.
    pub apart: Option<u32>,
    /// Keyframes before it to which it was aligned.
    pub edges: Vec<u32>,
}

/// What became of a loop pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReportedVerdict {
    /// It takes part.
    Accepted,
    /// A test refused it.
    Refused,
    /// The rest of the graph contradicts it.
    Outvoted,
    /// The aligner saw it; no optimisation has judged it (yet).
    Untested,
}

/// A pair of keyframes that would close a loop.
#[derive(Clone, Debug, PartialEq)]
pub struct LoopPair {
    /// The newer keyframe.
    pub newer: u32,
    /// The older keyframe.
    pub older: u32,
    /// What became of it.
    pub verdict: ReportedVerdict,
    /// Why, in words.
    pub words: String,
    /// Overlap, share in front, inconsistency and residual in standard deviations, weight.
    pub numbers: [f64; 5],
}

/// What a stage did over all its lives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StageFigures {
    /// Its name.
    pub name: String,
    /// Frames (or requests) done.
    pub frames: u64,
    /// Lives after the first.
    pub restarts: u64,
    /// Median, 99th percentile and longest time for one, milliseconds.
    pub latency_ms: [f64; 3],
    /// CPU time for each frame of the run, milliseconds; `None` where it is not counted.
    pub cpu_ms_per_frame: Option<f64>,
    /// Highest resident set, megabytes; `None` where it is no process.
    pub peak_rss_mb: Option<f64>,
    /// How often one took how long: end of the bucket in milliseconds, and how many.
    pub latency_counts: Vec<(f64, u64)>,
}

/// A warning or an error of the log.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Event {
    /// Time of day.
    pub time: String,
    /// Level.
    pub level: String,
    /// What was said.
    pub words: String,
}

/// One setting.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Setting {
    /// Key as `--set` takes it.
    pub key: String,
    /// Value of this run.
    pub value: String,
    /// Value without any configuration; `None`: there is none.
    pub default: Option<String>,
}

/// A frame to look at.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorstFrame {
    /// The frame.
    pub index: u64,
    /// Why it is shown.
    pub words: String,
    /// What each picture is, and the picture.
    pub pictures: Vec<(String, ReportPicture)>,
}

/// A run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReportedRun {
    /// Name or folder.
    pub name: String,
    /// What was run.
    pub source: String,
    /// How it ended, in a few words.
    pub ended: String,
    /// Whether that is a reason to worry.
    pub is_alarming: bool,
    /// Reasons of the verdict, in sentences.
    pub reasons: Vec<String>,
    /// What and how much: the summary.
    pub facts: Vec<(String, String)>,
    /// Where it was made: the program, the machine.
    pub machine: Vec<(String, String)>,
    /// Frames in the order of their index.
    pub frames: Vec<Frame>,
    /// True positions; empty without ground truth.
    pub truth_m: Vec<[f64; 3]>,
    /// Keyframes by id.
    pub keyframes: Vec<Keyframe>,
    /// Loop pairs.
    pub loops: Vec<LoopPair>,
    /// The map and the trajectory in 3D; `None`: see the run's own report.
    pub scene: Option<ReportScene>,
    /// Stages in the order of the flow.
    pub stages: Vec<StageFigures>,
    /// In the order of time; empty where they were not recorded.
    pub samples: Vec<TimelineSample>,
    /// Lines of the log, oldest first.
    pub events: Vec<Event>,
    /// Of those, left out here.
    pub n_more_events: usize,
    /// All settings.
    pub settings: Vec<Setting>,
    /// Frames to look at, worst first.
    pub worst: Vec<WorstFrame>,
    /// Why there are no pictures, where there are none.
    pub no_pictures: Option<String>,
}

impl ReportedRun {
    /// Whether positions can be compared with the truth.
    pub(crate) fn has_truth(&self) -> bool {
        !self.truth_m.is_empty()
    }
}
