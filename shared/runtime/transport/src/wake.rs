//! Wake-up events: one event service per stage, notified by all its producers.
//!
//! A stage waits on a single listener, so it needs no wait set. The time-out of a wait is the
//! safety net, also for signals and for the end of the supervisor.

use crate::error::TransportError;
use iceoryx2::port::listener::{Listener as EventListener, ListenerWaitError};
use iceoryx2::port::notifier::Notifier as EventNotifier;
use iceoryx2::prelude::ipc;
use std::time::Duration;

/// Notifier of one stage's event.
#[derive(Debug)]
pub struct Notifier {
    pub(crate) port: EventNotifier<ipc::Service>,
}

impl Notifier {
    /// Wakes the stage; never blocks, also without a listener.
    pub fn notify(&self) {
        // A listener that has just died is the supervisor's business; the time-out covers the rest.
        let _ = self.port.notify();
    }
}

/// Listener on a stage's own event.
#[derive(Debug)]
pub struct Listener {
    pub(crate) port: EventListener<ipc::Service>,
}

impl Listener {
    /// Sleeps until a notification or the end of `timeout`; `true` where a notification came.
    ///
    /// # Errors
    /// Where the event is broken.
    pub fn wait(&self, timeout: Duration) -> Result<bool, TransportError> {
        let mut is_notified = false;
        match self.port.timed_wait(|_| is_notified = true, timeout) {
            Ok(_) => Ok(is_notified),
            // A signal came: the caller checks its lifeline.
            Err(ListenerWaitError::InterruptSignal) => Ok(false),
            Err(error) => {
                Err(TransportError::Message { action: "wait", service: "wake", reason: format!("{error:?}") })
            }
        }
    }
}
