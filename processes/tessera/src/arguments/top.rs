//! Arguments of `tessera top`.

use clap::Args;
use std::net::SocketAddr;
use tessera_report::loopback_address;

/// `tessera top`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
The run is only listened to, and is not affected. With --json each look is one
line.

Examples:
  tessera top
  tessera top room-1
  tessera top room-1 --json --count 10
  tessera top room-1 --metrics 127.0.0.1:9464")]
pub(crate) struct TopArguments {
    /// Name of the run, or its folder [default: the one that is going on]
    pub(crate) run: Option<String>,
    /// Seconds between two looks
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = seconds)]
    pub(crate) interval: f64,
    /// End after so many looks
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
    /// Print a line of JSON for each look
    #[arg(long)]
    pub(crate) json: bool,
    /// Answer Prometheus at this address of the loopback interface (port 0: a free one)
    #[arg(long, value_name = "127.0.0.1:PORT", value_parser = loopback_address, conflicts_with_all = ["json", "count"])]
    pub(crate) metrics: Option<SocketAddr>,
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.05..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("expected seconds from 0.05 to 3600".to_owned()),
    }
}
