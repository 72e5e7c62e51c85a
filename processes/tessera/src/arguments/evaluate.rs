//! `tessera evaluate`: its arguments.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What offset of stamps to report beside the standard figures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum TimeOffset {
    /// The constant offset that fits best.
    Auto,
}

/// `tessera evaluate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
ATE is the absolute trajectory error after rigid alignment, RPE the relative
pose error over one second, both by the definitions of the TUM scripts. Further
figures stand beside the standard ones, never instead.

Examples:
  tessera evaluate room-1
  tessera evaluate runs/room-1/trajectory.txt runs/room-1/groundtruth.txt
  tessera evaluate estimate.txt groundtruth.txt --json
  tessera evaluate estimate.txt groundtruth.txt --time-offset auto --scale")]
pub(crate) struct EvaluateArguments {
    /// The estimated trajectory, lines of `timestamp tx ty tz qx qy qz qw`; or the name or folder of a run
    pub(crate) estimate: PathBuf,
    /// The true trajectory, in the same form [default: that of the run]
    pub(crate) groundtruth: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// Report the figures under the best constant offset of the stamps too
    #[arg(long, value_name = "auto")]
    pub(crate) time_offset: Option<TimeOffset>,
    /// Report the ATE with the scale corrected too
    #[arg(long)]
    pub(crate) scale: bool,
}
