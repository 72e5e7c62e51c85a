//! Notifications of the service manager: ready, alive, stopping.
//!
//! The protocol of `sd_notify(3)`: one datagram to the socket that `NOTIFY_SOCKET` names; without
//! that variable nothing is sent. The crate `sd-notify` 0.5 does not fit: it sends to no abstract
//! socket (`@name`), and its send blocks while the reader's queue is full.

use crate::clock::monotonic_nanos;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};

/// Environment variables by which systemd asks for notifications; the supervisor does not hand
/// them to its stages.
pub const NOTIFY_VARIABLES: [&str; 3] = ["NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"];

/// Sender of notifications to systemd, if it asked for them.
#[derive(Debug, Default)]
pub struct SystemdNotifier {
    to: Option<(UnixDatagram, SocketAddr)>,
    /// Time between two signs of life, nanoseconds; 0: none are wanted.
    interval_nanos: u64,
    last_alive: u64,
}

impl SystemdNotifier {
    /// The notifier that the environment describes.
    pub fn from_environment() -> Self {
        let [socket, timeout, pid] = NOTIFY_VARIABLES.map(std::env::var_os);
        let to = socket.and_then(|path| {
            let address = match path.as_bytes() {
                [b'@', name @ ..] => SocketAddr::from_abstract_name(name),
                _ => SocketAddr::from_pathname(&path),
            };
            let socket = UnixDatagram::unbound().ok()?;
            // A reader that is late costs a sign of life, never a frame.
            socket.set_nonblocking(true).ok()?;
            Some((socket, address.ok()?))
        });
        let word = |value: Option<std::ffi::OsString>| value?.to_str()?.parse::<u64>().ok();
        let is_meant = word(pid).is_none_or(|pid| pid == u64::from(std::process::id()));
        let timeout_micros = word(timeout).filter(|_| is_meant).unwrap_or_default();
        // Twice in the time allowed, as systemd advises.
        Self { to, interval_nanos: timeout_micros.saturating_mul(500), last_alive: 0 }
    }

    /// Reports that the service can be used.
    pub fn ready(&self) {
        self.send("READY=1");
    }

    /// Reports that the service ends by itself.
    pub fn stopping(&self) {
        self.send("STOPPING=1");
    }

    /// Keep-alive of the watchdog; sends at most one in half the watchdog's time-out.
    pub fn alive(&mut self) {
        let now = monotonic_nanos();
        if self.interval_nanos > 0 && now.saturating_sub(self.last_alive) >= self.interval_nanos {
            self.last_alive = now;
            self.send("WATCHDOG=1");
        }
    }

    fn send(&self, word: &str) {
        if let Some((socket, address)) = &self.to {
            // A sign of life that cannot be sent is missed: systemd sees to that.
            let _ = socket.send_to_addr(word.as_bytes(), address);
        }
    }
}
