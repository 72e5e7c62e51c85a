//! What a run leaves for its user: pure functions of the run directory, so that they can be
//! written at any time, also after a crash, and say the same.

mod export;
mod files;
mod map;
mod replay;
mod states;
mod statistics;
mod summary;
#[cfg(test)]
mod test_run;
mod trajectories;
mod voxels;

pub(crate) use export::{export, write_groundtruth};
pub(crate) use statistics::{Ended, LatencyMs, RunStatistics, read_statistics, write_statistics};
pub(crate) use summary::Summary;
