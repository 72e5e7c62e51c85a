//! `tessera top --metrics` and `tessera run --metrics`: figures for Prometheus, on the loopback interface alone.

use crate::exit::CommandError;
use crate::terminal::say;
use crate::top::{Watcher, metrics};
use std::net::{SocketAddr, TcpListener};
use std::os::fd::{AsFd, OwnedFd};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use tessera_report::{METRICS_PATH, answer};

/// Time between two looks for a question.
const POLL: Duration = Duration::from_millis(50);

/// Set for a server whose standard input is the socket to answer at.
const SOCKET_VARIABLE: &str = "TESSERA_METRICS_SOCKET";

/// Opens the socket; answers it with the address that it has got.
///
/// # Errors
/// Where the address cannot be had.
pub(crate) fn listen(address: SocketAddr) -> Result<(TcpListener, SocketAddr), CommandError> {
    let cannot = |error: std::io::Error| CommandError::arguments(format!("--metrics {address}: {error}"));
    let listener = TcpListener::bind(address).map_err(cannot)?;
    let bound = listener.local_addr().map_err(cannot)?;
    Ok((listener, bound))
}

/// A process of its own that answers for a run until the run is over: a stranger to it like
/// `tessera top`, whatever becomes of it.
pub(crate) struct MetricsServer(Child);

impl MetricsServer {
    /// Starts it for the run of a folder.
    ///
    /// # Errors
    /// Where the process cannot be started.
    pub(crate) fn start(program: &Path, run_dir: &Path, listener: &TcpListener) -> std::io::Result<Self> {
        let socket = OwnedFd::from(listener.try_clone()?);
        let address = listener.local_addr()?.to_string();
        let mut command = Command::new(program);
        command
            .arg("top")
            .arg(run_dir)
            .args(["--metrics", &address])
            .env(SOCKET_VARIABLE, "1")
            .stdin(socket)
            .stdout(Stdio::null());
        Ok(Self(command.spawn()?))
    }
}

impl Drop for MetricsServer {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Answers questions for as long as `goes_on` says so.
pub(crate) fn serve(
    address: SocketAddr,
    watcher: &mut Watcher,
    mut goes_on: impl FnMut() -> Result<bool, CommandError>,
) -> Result<(), CommandError> {
    let cannot = |error: std::io::Error| CommandError::arguments(format!("--metrics {address}: {error}"));
    let listener = match std::env::var_os(SOCKET_VARIABLE) {
        Some(_) => TcpListener::from(std::io::stdin().as_fd().try_clone_to_owned().map_err(cannot)?),
        None => {
            let (listener, bound) = listen(address)?;
            say(&format!("metrics on http://{bound}/metrics, for this machine alone"));
            listener
        }
    };
    listener.set_nonblocking(true).map_err(cannot)?;
    while goes_on()? {
        watcher.listen(POLL)?;
        while let Ok((stream, _)) = listener.accept() {
            // A client that goes away harms itself alone.
            let _ = answer(stream, METRICS_PATH, || metrics(&watcher.look()).into());
        }
    }
    Ok(())
}
