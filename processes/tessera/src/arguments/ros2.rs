//! Arguments of `tessera ros2`.

use clap::Args;
use std::ffi::OsString;

/// `tessera ros2`.
#[derive(Clone, Debug, Args)]
#[command(
    disable_help_flag = true,
    after_help = "\
A program of its own does it, tessera-ros2, which is built apart (docs/ros2.md) and takes all arguments.

Examples:
  tessera ros2 desk --run                 start a run on the camera's topics
  tessera ros2 desk                       for a run external that is there or will be
  tessera ros2 --help                     all options"
)]
pub(crate) struct Ros2Arguments {
    /// Name of the run, then options
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "NAME", required = true)]
    pub(crate) arguments: Vec<OsString>,
}
