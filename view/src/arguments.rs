//! The command line.

use clap::Parser;
use std::path::PathBuf;

/// Show a run in Rerun: as it goes on, or one that is over
#[derive(Debug, Parser)]
#[command(name = "tessera-view", version, max_term_width = 80)]
pub(crate) struct RerunArguments {
    /// Name of the run, or its folder
    #[arg(default_value = "", required_unless_present = "of_supervisor", hide_default_value = true)]
    pub(crate) run: String,
    /// Write a file instead of opening a viewer
    #[arg(long, value_name = "FILE.rrd", conflicts_with = "connect")]
    pub(crate) save: Option<PathBuf>,
    /// Feed a viewer that is open already, such as rerun+http://127.0.0.1:9876/proxy
    #[arg(long, value_name = "URL")]
    pub(crate) connect: Option<String>,
    /// Images and surfaces a second, at most; 0: none
    #[arg(long, value_name = "N", default_value_t = 5.0, value_parser = rate)]
    pub(crate) images_per_s: f64,
    /// Points of a keyframe, at most
    #[arg(long, value_name = "N", default_value_t = 4000)]
    pub(crate) keyframe_points: usize,
    /// Memory of the viewer that is opened, at most; it then forgets what is oldest
    #[arg(long, value_name = "SIZE", default_value = "2GB")]
    pub(crate) memory: String,
    /// The run that this supervisor is about to start
    #[arg(long, value_name = "PID", hide = true)]
    pub(crate) of_supervisor: Option<u32>,
}

fn rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if (0.0..=60.0).contains(&rate) => Ok(rate),
        _ => Err("expected a number from 0 to 60".to_owned()),
    }
}
