//! What a run leaves for its user: pure functions of the run directory, so that they can be
//! written at any time, also after a crash, and say the same.

mod accuracy;
mod export;
mod files;
mod machine;
mod map;
mod replay;
mod states;
mod statistics;
mod summary;
#[cfg(test)]
pub(crate) mod test_run;
mod timeline;
mod trajectories;
mod voxels;
mod words;

pub(crate) use export::{
    export, map_keyframes, read_groundtruth, read_journal, read_settings, refined_warp, write_groundtruth,
};
pub(crate) use files::write_file;
pub(crate) use machine::Machine;
pub(crate) use replay::Replay;
pub(crate) use statistics::{Ended, LatencyMs, RunStatistics, read_statistics, write_statistics};
pub(crate) use summary::Summary;
pub(crate) use timeline::{END_TO_END, Point, Recorder, Sample, Timeline, read_timeline, write_timeline};
pub(crate) use trajectories::{as_trajectory, final_rows, keyframe_rows};
