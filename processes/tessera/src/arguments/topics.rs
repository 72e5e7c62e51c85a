//! Topics of a recording.

use clap::Args;

/// Topics of an MCAP file.
#[derive(Clone, Debug, Default, Args)]
pub(crate) struct TopicArguments {
    /// In FILE.mcap: the topic of depth [default: the one whose name says so]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) depth_topic: Option<String>,
    /// In FILE.mcap: the topic of colour [default: the one whose name says so]
    #[arg(long, value_name = "TOPIC")]
    pub(crate) color_topic: Option<String>,
}
