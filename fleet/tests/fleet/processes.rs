//! Uplinks and bases as processes of their own.

use std::collections::BTreeMap;
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tessera_fleet::status::Status;

/// A process that dies with the test.
pub(crate) struct Process(pub(crate) Child);

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Process {
    /// kill -9.
    pub(crate) fn kill(&mut self) {
        let _ = self.0.kill();
        self.0.wait().unwrap();
    }

    pub(crate) fn wait_for_success(&mut self, what: &str) {
        wait_for(what, || self.0.try_wait().unwrap().is_some());
        assert!(self.0.wait().unwrap().success(), "{what}");
    }
}

pub(crate) fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let deadline = Instant::now() + Duration::from_secs(300);
    while !holds() {
        assert!(Instant::now() < deadline, "waited in vain for {what}");
        std::thread::sleep(Duration::from_millis(20));
    }
}

pub(crate) fn fleet(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tessera-fleet"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null());
    command
}

pub(crate) fn start(arguments: &[&str]) -> Process {
    Process(fleet(arguments).spawn().unwrap())
}

pub(crate) fn uplink(run: &Path, robot: &str, port: u16) -> Process {
    let to = format!("tcp/127.0.0.1:{port}");
    start(&["uplink", run.to_str().unwrap(), "--to", &to, "--robot", robot, "--quiet"])
}

/// A base that ends once so many runs have ended and their map is made.
pub(crate) fn base(folder: &Path, port: u16, n_runs: usize) -> Process {
    let (folder, listen) = (folder.to_str().unwrap(), format!("tcp/127.0.0.1:{port}"));
    let n_runs = n_runs.to_string();
    start(&["base", folder, "--listen", &listen, "--runs", &n_runs, "--map-every", "1", "--quiet"])
}

/// A port that nothing listens on now.
pub(crate) fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
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
    let mut runs = std::fs::read_dir(base.join("robots").join(robot)).unwrap();
    runs.next().unwrap().unwrap().path()
}

/// Every file of a base's map.
pub(crate) fn map_files(base: &Path) -> BTreeMap<String, Vec<u8>> {
    let files = std::fs::read_dir(base.join("map")).unwrap().map(|entry| entry.unwrap());
    files
        .map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap()))
        .collect()
}
