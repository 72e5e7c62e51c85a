//! Sleeping until there is work: one event per stage, which all its producers ring.
//!
//! A stage has one thing to wait for, so one listener does what a wait set would; the end of its
//! time-out is the safety net, also for what comes from outside (signals, the supervisor's end).

use crate::error::TransportError;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::ipc;
use std::time::Duration;

/// Wakes one stage.
#[derive(Debug)]
pub struct Bell {
    pub(crate) notifier: Notifier<ipc::Service>,
}

impl Bell {
    /// Wakes the stage; never blocks, also where nobody listens.
    pub fn ring(&self) {
        // A listener that has just died is the supervisor's business; the time-out covers the rest.
        let _ = self.notifier.notify();
    }
}

/// Where a stage sleeps.
#[derive(Debug)]
pub struct Ear {
    pub(crate) listener: Listener<ipc::Service>,
}

impl Ear {
    /// Sleeps until the bell rings or the time is over; `true` where it rang.
    ///
    /// # Errors
    /// Where the event is broken.
    pub fn wait(&self, timeout: Duration) -> Result<bool, TransportError> {
        let mut rang = false;
        match self.listener.timed_wait(|_| rang = true, timeout) {
            Ok(_) => Ok(rang),
            // A signal came: the caller looks at what it wants.
            Err(iceoryx2::port::listener::ListenerWaitError::InterruptSignal) => Ok(false),
            Err(error) => {
                Err(TransportError::Message { action: "wait", service: "wake", reason: format!("{error:?}") })
            }
        }
    }
}
