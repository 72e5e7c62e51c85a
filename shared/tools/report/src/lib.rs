//! Report on one run or several, as one page of HTML: self-contained, with one script of its
//! own that draws the map in 3D, good on a screen, on a phone and on paper.
//!
//! The page is a pure function of [`ReportedRun`]; the folder `run_directory` fills that in.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

mod chart;
mod compare;
mod exposition;
mod graph;
mod http;
mod joint_scene;
mod page;
mod palette;
mod picture;
mod run;
mod run_directory;
mod scene;
mod sections;
mod serve;
mod tracks;
mod work;
mod worst;

pub use chart::{Chart, ChartForm, Series};
pub use exposition::{Exposition, METRICS_PATH, loopback_address};
pub use http::{Answer, answer};
pub use joint_scene::{JointComponent, JointFrame, joint_scene};
pub use page::{page, whole_page};
pub use palette::{CYCLE, GREY, cycled};
pub use picture::{ReportPicture, ThumbnailError, depth_picture, photograph};
pub use run::{
    Event, Frame, FrameState, Keyframe, LoopPair, ReportedRun, ReportedVerdict, Setting, StageFigures,
    WorstFrame,
};
pub use run_directory::{REPORT_FILE, write, write_read};
pub use scene::{
    ReportScene, SceneFrame, SceneKeyframe, SceneLoop, ScenePart, ScenePoint, SceneRobot, SceneSubmap,
};
pub use serve::{LivePage, PageServer, RunPage};

/// Why a page could not be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw {what}: {reason}")]
pub struct ReportError {
    /// Which plot or picture.
    pub what: String,
    /// What the library said.
    pub reason: String,
}
