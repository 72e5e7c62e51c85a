//! Arguments of `tessera record` and `tessera profile`.

use clap::Args;
use std::path::PathBuf;

/// `tessera record`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
The input of align is its surfaces and the corrections, each with the frame
before which it took effect. It is what four processes would exchange, to the
bit.

Examples:
  tessera record room --stage align --out room.align
  tessera record FOLDER --stage reconstruct --frames 100 --out desk.reconstruct
  tessera profile align room.align --repeat 5")]
pub(crate) struct RecordArguments {
    /// A recording, or a simulated world
    pub(crate) source: String,
    /// reconstruct, align or optimise
    #[arg(long, value_name = "STAGE")]
    pub(crate) stage: String,
    /// The file to write
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// A camera file, or freiburg1, freiburg2, freiburg3, icl, 7scenes, primesense [default: the folder's camera.toml]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// A preset (default, paper, fast, onboard) or a TOML file
    #[arg(long, value_name = "PRESET|FILE")]
    pub(crate) config: Option<String>,
    /// Change one setting; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Leave out so many frames at the beginning
    #[arg(long, value_name = "N")]
    pub(crate) skip: Option<u64>,
    /// Process at most so many frames
    #[arg(long, value_name = "N")]
    pub(crate) frames: Option<u64>,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}

/// `tessera profile`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
The stage runs in this process, with nothing beside it: this is what to put
under perf, valgrind or a flame graph. Each result is compared with what the
pipeline made of the same input.

Examples:
  tessera profile align room.align
  tessera profile align room.align --repeat 5 --json
  perf record tessera profile align room.align --no-steps")]
pub(crate) struct ProfileArguments {
    /// reconstruct, align or optimise
    pub(crate) stage: String,
    /// What `tessera record` wrote
    pub(crate) file: PathBuf,
    /// Passes over the whole recording
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub(crate) repeat: u64,
    /// Measure the whole stage only
    #[arg(long)]
    pub(crate) no_steps: bool,
    /// Print JSON
    #[arg(long)]
    pub(crate) json: bool,
}
