//! Arguments of commands that are programs of their own: they take them all.

use clap::Args;
use std::ffi::OsString;

/// `tessera ros2`, `tessera uplink`, `tessera base`.
#[derive(Clone, Debug, Args)]
#[command(disable_help_flag = true)]
pub(crate) struct PassedOn {
    /// Name of the run or folder of the base, then options
    #[arg(trailing_var_arg = true, allow_hyphen_values = true, value_name = "NAME", required = true)]
    pub(crate) arguments: Vec<OsString>,
}

pub(super) const ROS2: &str = "\
A program of its own does it, tessera-ros2, which is built apart (docs/ros2.md) and takes all arguments.

Examples:
  tessera ros2 desk --run                 start a run on the camera's topics
  tessera ros2 desk                       for a run external that is there or will be
  tessera ros2 --help                     all options";

pub(super) const FLEET: &str = "\
A program of its own does it, tessera-fleet, which is built apart (docs/fleet.md) and takes all arguments.

Examples:
  tessera uplink room-1 --to tcp/127.0.0.1:7447 --robot a
  tessera base fleet                      wait for robots
  tessera base house --add runs/a --add runs/b
  tessera base --help                     all options; uplink has its own";
