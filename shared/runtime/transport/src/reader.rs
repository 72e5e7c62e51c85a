//! A subscriber that is made anew where it missed a publisher.

use crate::error::TransportError;
use crate::patience::patiently;
use crate::reach::ServiceReach;
use iceoryx2::port::ReceiveError;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{IceoryxSend, Node, ZeroCopySend, ipc};
use std::cell::RefCell;
use std::fmt::Debug;

/// The reading end of a service.
#[derive(Debug)]
pub(crate) struct ReaderPort<P, H>
where
    P: IceoryxSend + Debug + ?Sized + 'static,
    H: ZeroCopySend + Debug + 'static,
{
    /// `None` only where it could not be made anew.
    port: RefCell<Option<Subscriber<ipc::Service, P, H>>>,
    reach: ServiceReach<P, H>,
}

impl<P, H> ReaderPort<P, H>
where
    P: IceoryxSend + Debug + ?Sized + 'static,
    H: ZeroCopySend + Debug + 'static,
{
    /// Connects to all writers; `node`, where given, cleans up after dead readers where there is no place.
    ///
    /// # Errors
    /// Where there is no place, or a living writer cannot be reached.
    pub(crate) fn open(
        reach: ServiceReach<P, H>,
        node: Option<&Node<ipc::Service>>,
    ) -> Result<Self, TransportError> {
        let reader = Self { port: RefCell::new(None), reach };
        reader.connect(node)?;
        Ok(reader)
    }

    /// Receives by the port's own function.
    ///
    /// # Errors
    /// Where that fails, or a living writer cannot be reached; the next call tries it again.
    pub(crate) fn receive<T>(
        &self,
        receive: impl Fn(&Subscriber<ipc::Service, P, H>) -> Result<Option<T>, ReceiveError>,
    ) -> Result<Option<T>, TransportError> {
        let received = self.receive_connected(&receive)?;
        // What has come goes first: a new port gets no more than the writers' history.
        if received.is_some() || (self.port.borrow().is_some() && !self.reach.has_missed()) {
            return Ok(received);
        }
        if !has_room() {
            return if self.reach.is_tolerant { Ok(None) } else { Err(self.reach.unreached()) };
        }
        self.connect(None)?;
        self.receive_connected(&receive)
    }

    fn receive_connected<T>(
        &self,
        receive: impl Fn(&Subscriber<ipc::Service, P, H>) -> Result<Option<T>, ReceiveError>,
    ) -> Result<Option<T>, TransportError> {
        self.port.borrow().as_ref().map_or(Ok(None), |port| {
            receive(port).map_err(|e| TransportError::Message {
                action: "receive",
                service: self.reach.service,
                reason: format!("{e:?}"),
            })
        })
    }

    /// Makes the port, anew where there was one: only a new one connects with all writers. Where one missed but a
    /// dead writer it goes too. It keeps the key of the connection that was in the dead one's place, and drops by it
    /// the connection of a living writer that has got the same key (`connections` in iceoryx2's
    /// `port/details/receiver.rs`).
    fn connect(&self, node: Option<&Node<ipc::Service>>) -> Result<(), TransportError> {
        // The new one needs its place.
        drop(self.port.take());
        let port = patiently(&format!("a subscriber of {}", self.reach.service), node, || {
            let builder = self.reach.factory.subscriber_builder();
            builder.set_degradation_handler(self.reach.reader_handler()).create()
        })?;
        self.port.replace(Some(port));
        self.reach.check_writers()
    }
}

/// Whether there is memory for a port: iceoryx2 0.10 does not check what it allocates for its connections, and without
/// memory ends by a bad access (`SlotMap::new` in `Subscriber::new`).
fn has_room() -> bool {
    /// Ten times what a subscriber takes.
    const BYTES: usize = 1 << 20;
    let mut room = Vec::<u8>::new();
    let has_room = room.try_reserve_exact(BYTES).is_ok();
    // Unused, it would not be allocated.
    std::hint::black_box(room);
    has_room
}
