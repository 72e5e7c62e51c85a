//! Small messages of a fixed size.

use crate::error::TransportError;
use crate::wire::Wire;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;
use tessera_messages::Message;

/// Writes messages of one type.
#[derive(Debug)]
pub struct Publisher<T: Message> {
    pub(crate) port: iceoryx2::port::publisher::Publisher<ipc::Service, Wire<T>, ()>,
    pub(crate) service: &'static str,
}

impl<T: Message> Publisher<T> {
    /// Sends a copy.
    ///
    /// # Errors
    /// Where iceoryx2 cannot; a service without a reader is no error.
    pub fn send(&self, message: T) -> Result<(), TransportError> {
        self.port.send_copy(Wire(message)).map(drop).map_err(|e| TransportError::Message {
            action: "send",
            service: self.service,
            reason: format!("{e:?}"),
        })
    }

    /// Gives late readers their history; to be called now and then by a writer that is idle.
    pub fn update(&self) {
        let _ = self.port.update_connections();
    }
}

/// Reads messages of one type.
#[derive(Debug)]
pub struct Subscriber<T: Message> {
    pub(crate) port: iceoryx2::port::subscriber::Subscriber<ipc::Service, Wire<T>, ()>,
    pub(crate) service: &'static str,
}

impl<T: Message> Subscriber<T> {
    /// A copy of the oldest message that waits.
    ///
    /// # Errors
    /// Where a connection is broken.
    pub fn receive(&self) -> Result<Option<T>, TransportError> {
        match self.port.receive() {
            Ok(sample) => Ok(sample.map(|sample| sample.payload().0)),
            Err(e) => Err(TransportError::Message {
                action: "receive",
                service: self.service,
                reason: format!("{e:?}"),
            }),
        }
    }

    /// A copy of the newest message that waits; older ones are dropped.
    ///
    /// # Errors
    /// Where a connection is broken.
    pub fn newest(&self) -> Result<Option<T>, TransportError> {
        let mut newest = None;
        while let Some(message) = self.receive()? {
            newest = Some(message);
        }
        Ok(newest)
    }
}
