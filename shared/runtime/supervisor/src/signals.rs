//! Waiting for the end of a child, a signal, or a timeout.

use crate::failure::SupervisorError;
use signal_hook::consts::{SIGCHLD, SIGINT, SIGTERM};
use std::io::Read;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Signals to the supervisor, as bytes in a socket and a flag.
pub(crate) struct Signals {
    wake: UnixStream,
    stop: Arc<AtomicBool>,
}

impl Signals {
    /// Listens from now on.
    ///
    /// # Errors
    /// Where the system refuses.
    pub(crate) fn listen() -> Result<Self, SupervisorError> {
        Self::register().map_err(|reason| SupervisorError::Spawn {
            what: "the supervisor".into(),
            reason: reason.to_string(),
        })
    }

    fn register() -> std::io::Result<Self> {
        let (wake, sender) = UnixStream::pair()?;
        let stop = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // The flag is set before the socket wakes us: handlers run in the order of registration.
            signal_hook::flag::register(signal, Arc::clone(&stop))?;
            signal_hook::low_level::pipe::register(signal, sender.try_clone()?)?;
        }
        signal_hook::low_level::pipe::register(SIGCHLD, sender)?;
        Ok(Self { wake, stop })
    }

    /// Sleeps until a signal comes, at most `timeout`.
    pub(crate) fn wait(&mut self, timeout: Duration) {
        let mut bytes = [0u8; 64];
        let _ = self.wake.set_read_timeout(Some(timeout.max(Duration::from_millis(1))));
        let _ = self.wake.read(&mut bytes);
    }

    /// Whether a signal has asked for the end of the run.
    pub(crate) fn wants_stop(&self) -> bool {
        self.stop.load(Ordering::Acquire)
    }
}
