//! `tessera chaos --fleet`: faults of the network and deaths of both ends on purpose, and the proof that
//! nothing was lost, nothing came twice, and the map is the undisturbed one.
//!
//! Everything stays on this machine: robots and base are processes of their own, joined over the loopback
//! interface, with a relay between each robot and the base that brings the faults.

mod arguments;
mod campaign;
mod processes;
mod pump;
mod relay;
mod report;
mod robot_run;
mod schedule;
mod simulated;
mod verdict;

pub use arguments::FleetChaosArguments;
pub use campaign::{MOST_ROBOTS, OnFault, fleet_campaign};
pub use processes::{ENDS_WITH, FleetProcess, Patience, Starter, end_with_parent, free_port};
pub use relay::{CarriedBytes, DELAY, Relay, THROTTLED_BYTES_PER_S};
pub use report::{FleetReport, RobotReport};
pub use robot_run::RobotRun;
pub use schedule::{FleetFault, FleetStrike, schedule};
pub use verdict::{copy_of, difference, map_difference, map_files};
