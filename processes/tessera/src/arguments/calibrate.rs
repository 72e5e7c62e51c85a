//! `tessera calibrate`: its arguments.

use clap::Args;
use std::path::PathBuf;

/// `tessera calibrate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
No target and no ground truth: surfaces seen twice must agree. Focal lengths,
principal point, lens, readout time and depth offset are solved for together
with the poses; what the motion does not determine keeps its start. The global
scale of depth cannot be known from depth and colour and stays as it is. It
takes motion with turns about several axes, near and far.

Examples:
  tessera calibrate FOLDER --out camera.toml
  tessera calibrate FOLDER --camera start.toml --out camera.toml
  tessera calibrate FOLDER --fix k3 --fix depth_offset_m --out camera.toml --json")]
pub(crate) struct CalibrateArguments {
    /// A recording, or a simulated world
    pub(crate) source: String,
    /// The camera to start from: a file, or freiburg1, freiburg2, freiburg3, icl, 7scenes, primesense [default: the source's own]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// The camera file to write
    #[arg(long, value_name = "FILE", default_value = "camera.toml")]
    pub(crate) out: PathBuf,
    /// Keep one parameter at its start; may be repeated
    #[arg(long, value_name = "PARAMETER")]
    pub(crate) fix: Vec<String>,
    /// A preset (default, paper, fast, onboard) or a TOML file
    #[arg(long, value_name = "PRESET|FILE")]
    pub(crate) config: Option<String>,
    /// Change one setting; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Use at most so many frames
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}
