//! Arguments of `tessera view`.

use clap::Args;
use std::path::PathBuf;

/// `tessera view`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Without --web a program of its own does it, tessera-view, which is built apart (docs/viewer.md). It reads the run's folder and the recording, and listens to the poses; the run does not notice.

Examples:
  tessera view room-1                     open the viewer, live or afterwards
  tessera view room-1 --web               the report in a browser, live or afterwards
  tessera view room-1 --save room.rrd     write a file for `rerun room.rrd`
  tessera run FOLDER --rerun desk.rrd     write it while the run goes on")]
pub(crate) struct ViewArguments {
    /// Name of the run, or its folder
    pub(crate) run: String,
    /// Show the report to browsers on this machine instead; it follows the run
    #[arg(long, conflicts_with_all = ["save", "connect"])]
    pub(crate) web: bool,
    /// Write a file instead of opening a viewer
    #[arg(long, value_name = "FILE.rrd", conflicts_with = "connect")]
    pub(crate) save: Option<PathBuf>,
    /// Feed a viewer that is open already, such as rerun+http://127.0.0.1:9876/proxy
    #[arg(long, value_name = "URL")]
    pub(crate) connect: Option<String>,
    /// Images and surfaces a second, at most; 0: none
    #[arg(long, value_name = "N", default_value_t = 5.0)]
    pub(crate) images_per_s: f64,
    /// Memory of the viewer that is opened, at most
    #[arg(long, value_name = "SIZE", default_value = "2GB")]
    pub(crate) memory: String,
}
