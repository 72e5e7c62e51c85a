//! A router of Zenoh beside a test: eclipse-zenoh in Python.

use crate::common::{Network, python, root, wait_for};
use crate::program::Program;
use std::path::PathBuf;
use std::process::Command;

/// A router on loopback, killed when it is dropped.
pub(crate) struct Router {
    python: PathBuf,
    dir: tempfile::TempDir,
    pub(crate) endpoint: String,
    program: Option<Program>,
    /// Folder with the certificates of both ends, where links are of TLS.
    keys: Option<PathBuf>,
}

impl Router {
    /// `None`, with the reason printed, where Python is missing.
    pub(crate) fn new() -> Option<Self> {
        Self::with(None)
    }

    /// The same with TLS, by the certificates in that folder.
    pub(crate) fn with(keys: Option<PathBuf>) -> Option<Self> {
        let python = python()?;
        let dir = tempfile::tempdir().unwrap();
        let mut router = Self { python, dir, endpoint: String::new(), program: None, keys };
        router.start();
        Some(router)
    }

    /// Starts it, on the port that it had.
    pub(crate) fn start(&mut self) {
        let file = self.dir.path().join("endpoint");
        let _ = std::fs::remove_file(&file);
        let mut command = Command::new(&self.python);
        command.arg(root().join("ros2/tests/python/router.py")).arg(&file);
        if !self.endpoint.is_empty() {
            command.arg(&self.endpoint);
        }
        if let Some(keys) = &self.keys {
            command.env("TEST_KEYS", keys);
        }
        self.program = Some(Program::start(command, true));
        wait_for("a router", || file.exists());
        self.endpoint = std::fs::read_to_string(&file).unwrap();
    }

    pub(crate) fn kill(&mut self) {
        self.program = None;
    }

    pub(crate) fn network(&self) -> Option<Network> {
        Some(Network::new()?.over(self.endpoint.clone(), self.keys.clone()))
    }
}
