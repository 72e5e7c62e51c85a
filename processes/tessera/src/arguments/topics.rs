//! Parts of a recording that are read.

use clap::Args;

/// Topics of an MCAP file, colour, and times.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct TopicArguments {
    /// In a bag or FILE.mcap: the topic of depth [default: found by type and name]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) depth_topic: Option<String>,
    /// In a bag or FILE.mcap: the topic of colour [default: found by type and name]; none: leave colour out, of
    /// folders too
    #[arg(long, value_name = "TOPIC", visible_alias = "colour")]
    pub(crate) color_topic: Option<String>,
    /// Frames a second where a folder's images have no times [default: 30]
    #[arg(long, value_name = "RATE")]
    pub(crate) fps: Option<f64>,
}
