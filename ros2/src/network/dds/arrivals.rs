//! Waiting for messages: RustDDS makes a reader's socket readable when a message has come.

use super::wrong;
use crate::carrier::CarrierError;
use mio::event::Source;
use mio::{Events, Interest, Poll, Token};
use std::time::Duration;

/// Readers whose messages end a wait.
pub(super) struct DdsArrivals {
    poll: Poll,
    events: Events,
}

impl DdsArrivals {
    pub(super) fn new() -> Result<Self, CarrierError> {
        let poll = Poll::new().map_err(|error| wrong("wait for messages", &error))?;
        Ok(Self { poll, events: Events::with_capacity(16) })
    }

    /// Messages of this reader end a wait from now on.
    pub(super) fn watch(&self, reader: &mut impl Source) -> Result<(), CarrierError> {
        let watched = self.poll.registry().register(reader, Token(0), Interest::READABLE);
        watched.map_err(|error| wrong("wait for messages", &error))
    }

    /// Sleeps until a message has come, or for that long; whether one has. Each is told once: all that
    /// wait are to be taken then.
    pub(super) fn wait(&mut self, timeout: Duration) -> bool {
        // A signal ends it early, as a message does: its caller looks at everything anyway.
        self.poll.poll(&mut self.events, Some(timeout)).is_err() || !self.events.is_empty()
    }
}
