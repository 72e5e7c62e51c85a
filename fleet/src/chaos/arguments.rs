//! What a campaign is asked for.

use clap::Args;
use std::path::PathBuf;

/// `tessera chaos --fleet`.
#[derive(Clone, Debug, Args)]
#[command(
    override_usage = "tessera chaos --fleet [OPTIONS]",
    after_help = "\
Robots and base are processes of their own on this machine, joined over the
loopback interface alone, with a relay between each robot and the base. It cuts
a link, delays it by 500 ms, throttles it to 50 kB/s, sends bytes twice, makes a
robot connect anew; uplinks and base are killed with SIGKILL. Runs grow from
their first byte to their last meanwhile. Then copies are compared with the
runs byte by byte, surfaces in the form in which they travel, and the map with
that of an undisturbed base which the runs came to in the same order. Exit code
0: the promise was kept; 4: it was not, and the folder stays for a look.

Examples:
  tessera chaos --fleet                           two runs of the simulated room
  tessera chaos --fleet --times 100 --seed 7      a hundred faults of each kind
  tessera chaos --fleet --run runs/a --run runs/b finished runs of your own"
)]
pub struct FleetChaosArguments {
    /// Faults of each of seven kinds
    #[arg(long, value_name = "N", default_value_t = 20,
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub times: u32,
    /// Seed of the faults: what, whom, how long
    #[arg(long, value_name = "S", default_value_t = 1)]
    pub seed: u64,
    /// Folder of a finished run, which is only read; twice or more, a robot each [default: two of
    /// the simulated room]
    #[arg(long, value_name = "RUNDIR")]
    pub run: Vec<PathBuf>,
    /// Empty folder for everything, which stays [default: a temporary one, removed when the
    /// promise was kept]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Longest time for everything, seconds
    #[arg(long, value_name = "S", default_value_t = 1800, value_parser = clap::value_parser!(u64).range(1..=86400))]
    pub patience_s: u64,
    /// The base copies whole run directories
    #[arg(long)]
    pub whole: bool,
    /// Flip a bit of a copy before it is compared, to see that this is found
    #[arg(long)]
    pub flip: bool,
    /// Print JSON lines: one for each fault, each robot, and the total
    #[arg(long)]
    pub json: bool,
    /// No progress
    #[arg(long, short)]
    pub quiet: bool,
}
