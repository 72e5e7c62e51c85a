//! Waiting for messages that threads of Zenoh bring.

use super::lock;
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

/// Whether a message has come since the last wait.
#[derive(Debug, Default)]
pub(super) struct ZenohArrivals {
    has_come: Mutex<bool>,
    changed: Condvar,
}

impl ZenohArrivals {
    /// A message has come.
    pub(super) fn tell(&self) {
        *lock(&self.has_come) = true;
        self.changed.notify_one();
    }

    /// Sleeps until a message has come since the last wait, or for that long; whether one has.
    pub(super) fn wait(&self, timeout: Duration) -> bool {
        let waited = self.changed.wait_timeout_while(lock(&self.has_come), timeout, |has_come| !*has_come);
        let (mut has_come, _) = waited.unwrap_or_else(PoisonError::into_inner);
        std::mem::take(&mut *has_come)
    }
}
