//! Outputs of a run: pure functions of the run directory, so that they can be
//! written at any time, also after a crash, and say the same.
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

mod accuracy;
mod colour;
mod comparison;
mod error;
mod export;
pub mod facts;
mod files;
pub mod html;
mod joint;
mod machine;
mod map;
mod noise;
mod ply;
mod preview;
mod read_run;
mod replay;
mod seen_focal;
mod states;
mod statistics;
mod stored;
mod summary;
#[cfg(any(test, feature = "test-run"))]
#[expect(clippy::arithmetic_side_effects, clippy::indexing_slicing, reason = "runs made up for tests")]
pub mod test_run;
mod timeline;
mod trajectories;
mod truth;
pub mod verdict;
mod verify;
mod voxels;
mod words;
mod wrong_camera;

pub use colour::ColourSummary;
pub use comparison::comparison;
pub use error::ToolError;
pub use export::{
    export, export_read, map_points, read_groundtruth, read_journal, read_map, read_settings, refined_warp,
    write_groundtruth,
};
pub use facts::deviation_m;
pub use files::write_file;
pub use joint::{JointCloud, joint_preview, write_joint_map};
pub use machine::Machine;
pub use noise::NoiseSummary;
pub use ply::{PlyVertex, write_ply};
pub use preview::{Preview, preview};
pub use read_run::{ReadRun, read_run};
pub use replay::Replay;
pub use statistics::{Ended, LatencyMs, RunStatistics, STATISTICS_FILE, read_statistics, write_statistics};
pub use stored::map_keyframes;
pub use summary::Summary;
pub use timeline::{END_TO_END, Point, Recorder, Timeline, TimelineSample, read_timeline, write_timeline};
pub use trajectories::{as_trajectory, final_rows, keyframe_rows};
pub use verdict::{Grade, Verdict};
pub use verify::{CheckedFile, FileState, Verified, verify};
pub use voxels::MapPoint;
