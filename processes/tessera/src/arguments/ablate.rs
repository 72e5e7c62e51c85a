//! `tessera ablate`: its arguments.

use clap::Args;

/// `tessera ablate`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
The first table is the RPE of the initial alignments: pairwise with every n-th
pixel, with the filter over k rings, with a window of w frames; each alignment
stands as it is, without failure tests. The second is the ATE of the whole
system, beside that of others where all frames take part (no --frames). All
runs of a sequence go through one process and give the same bits as `tessera
run`.

Examples:
  tessera ablate room --frames 60
  tessera ablate FOLDER --seeds 5 --json")]
pub(crate) struct AblateArguments {
    /// Recordings with ground truth, or simulated worlds
    #[arg(required = true, value_name = "SEQUENCE")]
    pub(crate) sequences: Vec<String>,
    /// A camera file, or freiburg1, freiburg2, freiburg3, icl, 7scenes, primesense [default: the folder's camera.toml]
    #[arg(long, value_name = "CAMERA")]
    pub(crate) camera: Option<String>,
    /// What the columns of the first table start from
    #[arg(long, value_name = "PRESET|FILE", default_value = "default")]
    pub(crate) config: String,
    /// Change one setting of all; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub(crate) overrides: Vec<String>,
    /// Process at most so many frames of each sequence
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) frames: Option<u64>,
    /// Sampling seeds; more than one give a median and a spread
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
    /// Print JSON instead of Markdown
    #[arg(long)]
    pub(crate) json: bool,
    /// No progress
    #[arg(long, short)]
    pub(crate) quiet: bool,
}
