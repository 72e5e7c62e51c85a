//! Uplinks and bases as processes of their own, as `tessera chaos --fleet` has them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use tessera_fleet::base::status::Status;
use tessera_fleet::chaos::{self, FleetProcess, Patience, Starter};

fn starter() -> Starter {
    Starter { program: env!("CARGO_BIN_EXE_tessera-fleet").into(), log: None, is_whole: false }
}

pub(crate) fn wait_for_success(process: &mut FleetProcess, what: &str) {
    wait_for(what, || process.ended().is_some());
    assert_eq!(process.ended(), Some(true), "{what}");
}

pub(crate) fn wait_for(what: &str, holds: impl FnMut() -> bool) {
    let patience =
        Patience { until: Instant::now() + Duration::from_secs(300), stop: &AtomicBool::new(false) };
    patience.wait_for(what, holds).unwrap();
}

pub(crate) fn fleet(arguments: &[&str]) -> Command {
    starter().command(arguments)
}

pub(crate) fn start(arguments: &[&str]) -> FleetProcess {
    starter().start(arguments).unwrap()
}

pub(crate) fn uplink(run: &Path, robot: &str, port: u16) -> FleetProcess {
    starter().uplink(run, robot, port).unwrap()
}

/// A base that ends once so many runs have ended and their map is made.
pub(crate) fn base(folder: &Path, port: u16, n_runs: usize) -> FleetProcess {
    starter().base(folder, port, n_runs).unwrap()
}

/// As [`base`], with copies that are whole runs.
pub(crate) fn whole_base(folder: &Path, port: u16, n_runs: usize) -> FleetProcess {
    Starter { is_whole: true, ..starter() }.base(folder, port, n_runs).unwrap()
}

/// A port that nothing listens on now.
pub(crate) fn free_port() -> u16 {
    chaos::free_port().unwrap()
}

pub(crate) fn status(base: &Path) -> Status {
    Status::read(base).unwrap_or_default()
}

/// Waits until a robot's run has arrived: the order of arrival is part of what a map is made of.
pub(crate) fn wait_for_robot(base: &Path, robot: &str) {
    wait_for(robot, || status(base).runs.iter().any(|run| run.robot == robot));
}

/// The folder of a robot's one run at the base.
pub(crate) fn copy_of(base: &Path, robot: &str) -> PathBuf {
    chaos::copy_of(base, robot).unwrap()
}

/// Every file of a base's map.
pub(crate) fn map_files(base: &Path) -> BTreeMap<String, Vec<u8>> {
    chaos::map_files(base).unwrap()
}
