//! Small messages of a fixed size.

use crate::error::TransportError;
use crate::reader::ReaderPort;
use crate::wire::Wire;
use crate::writer::WriterPort;
use tessera_messages::Message;

/// Writes messages of one type.
#[derive(Debug)]
pub struct Publisher<T: Message> {
    pub(crate) writer: WriterPort<Wire<T>, ()>,
}

impl<T: Message> Publisher<T> {
    /// Sends a copy.
    ///
    /// # Errors
    /// Where iceoryx2 cannot, or a living reader cannot be reached; a service without a reader is no error.
    pub fn send(&self, message: T) -> Result<(), TransportError> {
        self.writer.port.send_copy(Wire(message)).map_err(|e| TransportError::Message {
            action: "send",
            service: self.writer.reach.service,
            reason: format!("{e:?}"),
        })?;
        self.writer.reach.check_readers()
    }

    /// Gives late readers their history; to be called now and then by a writer that is idle.
    ///
    /// # Errors
    /// Where a living reader cannot be reached.
    pub fn update(&self) -> Result<(), TransportError> {
        self.writer.update()
    }
}

/// Reads messages of one type.
#[derive(Debug)]
pub struct Subscriber<T: Message> {
    pub(crate) reader: ReaderPort<Wire<T>, ()>,
}

impl<T: Message> Subscriber<T> {
    /// A copy of the oldest message that waits.
    ///
    /// # Errors
    /// Where a connection is broken, or a living writer cannot be reached.
    pub fn receive(&self) -> Result<Option<T>, TransportError> {
        let sample = self.reader.receive(|port| port.receive())?;
        Ok(sample.map(|sample| sample.payload().0))
    }

    /// A copy of the newest message that waits; older ones are dropped.
    ///
    /// # Errors
    /// As [`Self::receive`].
    pub fn newest(&self) -> Result<Option<T>, TransportError> {
        let mut newest = None;
        while let Some(message) = self.receive()? {
            newest = Some(message);
        }
        Ok(newest)
    }
}
