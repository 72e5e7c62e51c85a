//! The command line.

use crate::chaos::FleetChaosArguments;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::net::SocketAddr;
use std::path::PathBuf;
use tessera_report::loopback_address;

/// Many robots, one map, over Zenoh
#[derive(Debug, Parser)]
#[command(name = "tessera-fleet", version, max_term_width = 80)]
pub struct FleetArguments {
    /// What to do.
    #[command(subcommand)]
    pub command: FleetCommand,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum FleetCommand {
    /// On a robot: make a run available to a base
    Uplink(UplinkArguments),
    /// Off board: copy the runs of robots and make one map of them
    Base(BaseArguments),
    /// Disturb a fleet on purpose, and prove that it changed nothing
    Chaos(FleetChaosArguments),
}

/// `tessera uplink`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
It reads the run's folder and changes nothing; whatever becomes of it, the run does not notice.

Examples:
  tessera uplink room-1 --to tcp/127.0.0.1:7447 --robot a
  tessera uplink room-1 --config robot1.json5 --robot robot1    TLS, docs/fleet.md
  tessera uplink room-1 --config robot1.json5 --max-kbps 2000")]
pub struct UplinkArguments {
    /// Name of the run, or its folder; it may begin later
    pub run: String,
    /// Where the base listens; plain tcp on this machine alone
    #[arg(long, value_name = "LOCATOR", required_unless_present = "config")]
    pub to: Option<String>,
    /// Name of this robot; with TLS, that of its certificate [default: the host's name]
    #[arg(long, value_name = "NAME")]
    pub robot: Option<String>,
    /// Zenoh's configuration of this end: keys and certificates
    #[arg(long, value_name = "FILE.json5")]
    pub config: Option<PathBuf>,
    /// Kilobits a second, at most
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(8..))]
    pub max_kbps: Option<u32>,
    /// Say nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

/// `tessera base`.
#[derive(Clone, Debug, Args)]
#[command(after_help = "\
Without --config it listens on this machine alone, and with --add alone not at all.

Examples:
  tessera base fleet                                      listen on tcp/127.0.0.1:7447
  tessera base fleet status --json                        what it does and has
  tessera base fleet top                                  the same as it goes on
  tessera base fleet top --metrics 127.0.0.1:9465         for Prometheus
  tessera base fleet view                                 in a browser
  tessera base fleet --config base.json5                  TLS, docs/fleet.md
  tessera base house --add runs/monday --add runs/tuesday one map of finished runs")]
pub struct BaseArguments {
    /// Folder of the base, which it makes
    pub folder: PathBuf,
    /// Say what a base is doing, instead of being one
    #[arg(value_enum)]
    pub action: Option<Action>,
    /// How to look at it.
    #[command(flatten)]
    pub look: LookArguments,
    /// Take a run from disk too; ends when it is in the map, unless --listen or --config is given
    #[arg(long, value_name = "RUNDIR", conflicts_with = "action")]
    pub add: Vec<PathBuf>,
    /// Where to listen; plain tcp on this machine alone [default: tcp/127.0.0.1:7447]
    #[arg(long, value_name = "LOCATOR", conflicts_with = "action")]
    pub listen: Option<String>,
    /// Zenoh's configuration of this end: certificates, and who may say what
    #[arg(long, value_name = "FILE.json5", conflicts_with = "action")]
    pub config: Option<PathBuf>,
    /// End once N runs have come and ended, and their map is made
    #[arg(long, value_name = "N", conflicts_with = "action")]
    pub runs: Option<usize>,
    /// Copy whole run directories, with the surfaces of all keyframes as the robots have them
    #[arg(long, conflicts_with = "action")]
    pub whole: bool,
    /// A map each N seconds while runs go on; 0: when a run ends
    #[arg(long, value_name = "N", default_value_t = 30, conflicts_with = "action")]
    pub map_every: u64,
    /// Say nothing but errors
    #[arg(long, short)]
    pub quiet: bool,
}

/// What is asked of a base that is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Action {
    /// What it does and has
    Status,
    /// The same as it goes on, on a terminal
    Top,
    /// Its report as it goes on, for browsers on this machine
    View,
}

impl Action {
    /// As it stands on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Status => "status",
            Self::Top => "top",
            Self::View => "view",
        }
    }
}

/// How a base is looked at.
#[derive(Clone, Debug, Default, Args)]
pub struct LookArguments {
    /// With status: print JSON; with top: a line of JSON for each look
    #[arg(long, requires = "action")]
    pub json: bool,
    /// With top: answer Prometheus at this address of the loopback interface (port 0: a free one)
    #[arg(long, value_name = "127.0.0.1:PORT", value_parser = loopback_address, requires = "action",
          conflicts_with_all = ["json", "count", "interval"])]
    pub metrics: Option<SocketAddr>,
    /// With top: seconds between two looks [default: 1]
    #[arg(long, value_name = "S", value_parser = seconds, requires = "action")]
    pub interval: Option<f64>,
    /// With top: end after so many looks
    #[arg(long, value_name = "N", requires = "action")]
    pub count: Option<u64>,
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.05..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("expected seconds from 0.05 to 3600".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        FleetArguments::command().debug_assert();
        let parse = |line: &str| FleetArguments::try_parse_from(line.split(' '));
        assert!(parse("x uplink room-1 --to tcp/127.0.0.1:7447").is_ok());
        assert!(parse("x base fleet status --json").is_ok());
        assert!(parse("x base fleet top --json --interval 0.5 --count 2").is_ok());
        assert!(parse("x base fleet top --metrics 127.0.0.1:0").is_ok());
        assert!(parse("x chaos --times 100 --run a --run b --json").is_ok());
        for wrong in [
            "x uplink room-1",
            "x base fleet --json",
            "x base fleet stat",
            "x base fleet --count 2",
            "x base fleet top --interval 0",
            "x base fleet top --metrics 0.0.0.0:9465",
            "x base fleet top --metrics 127.0.0.1:0 --json",
            "x base fleet status --add a",
            "x chaos --times 0",
            "x chaos --times 1001",
            "x chaos --patience-s 86401",
        ] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
