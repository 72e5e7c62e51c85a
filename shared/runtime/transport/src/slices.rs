//! Bulk data: a header and a slice, written in place and read in place.
#![expect(unsafe_code, reason = "a loan from shared memory is initialised by what it is")]

use crate::error::TransportError;
use crate::reach::ServiceReach;
use crate::reader::ReaderPort;
use crate::wire::{Wire, WireElement};
use crate::writer::WriterPort;
use bytemuck::TransparentWrapper;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use std::rc::Rc;
use tessera_messages::{Element, Message};

/// Writes messages of a header and a slice.
#[derive(Debug)]
pub struct SlicePublisher<H: Message, E: Element> {
    pub(crate) writer: WriterPort<[WireElement<E>], Wire<H>>,
}

/// A message in the making, in shared memory.
#[derive(Debug)]
pub struct Loan<H: Message, E: Element> {
    sample: SampleMut<ipc::Service, [WireElement<E>], Wire<H>>,
    reach: Rc<ServiceReach<[WireElement<E>], Wire<H>>>,
}

impl<H: Message, E: Element> SlicePublisher<H, E> {
    /// Borrows room for a message of `len` elements; they hold whatever was there before.
    ///
    /// # Errors
    /// Where `len` is above the service's limit or all loans are out.
    pub fn loan(&self, len: usize) -> Result<Loan<H, E>, TransportError> {
        let sample = self.writer.port.loan_slice_uninit(len).map_err(|e| TransportError::Message {
            action: "borrow room",
            service: self.writer.reach.service,
            reason: format!("{e:?} for {len} elements"),
        })?;
        // SAFETY: the bytes lie in a mapped shared memory object, which the kernel has zeroed or
        // an earlier message has written; every bit pattern is a value of a `Pod` element.
        let sample = unsafe { sample.assume_init() };
        Ok(Loan { sample, reach: Rc::clone(&self.writer.reach) })
    }

    /// Gives late readers their history; to be called now and then by a writer that is idle.
    ///
    /// # Errors
    /// Where a living reader cannot be reached.
    pub fn update(&self) -> Result<(), TransportError> {
        self.writer.update()
    }
}

impl<H: Message, E: Element> Loan<H, E> {
    /// The header to fill in.
    pub fn header_mut(&mut self) -> &mut H {
        &mut self.sample.user_header_mut().0
    }

    /// The elements to write.
    pub fn payload_mut(&mut self) -> &mut [E] {
        WireElement::peel_slice_mut(self.sample.payload_mut())
    }

    /// Header and elements at once.
    pub fn split_mut(&mut self) -> (H, &mut [E]) {
        (self.sample.user_header().0, WireElement::peel_slice_mut(self.sample.payload_mut()))
    }

    /// Hands the message to all readers.
    ///
    /// # Errors
    /// Where iceoryx2 cannot, or a living reader cannot be reached; a service without a reader is no error.
    pub fn send(self) -> Result<(), TransportError> {
        self.sample.send().map_err(|e| TransportError::Message {
            action: "send",
            service: self.reach.service,
            reason: format!("{e:?}"),
        })?;
        self.reach.check_readers()
    }
}

/// Reads messages of a header and a slice.
#[derive(Debug)]
pub struct SliceSubscriber<H: Message, E: Element> {
    pub(crate) reader: ReaderPort<[WireElement<E>], Wire<H>>,
}

/// A message in shared memory, ours as long as we hold it, also when its sender has died.
#[derive(Debug)]
pub struct Received<H: Message, E: Element> {
    sample: Sample<ipc::Service, [WireElement<E>], Wire<H>>,
}

impl<H: Message, E: Element> SliceSubscriber<H, E> {
    /// The oldest message that waits.
    ///
    /// # Errors
    /// Where too many messages are held, a connection is broken, or a living writer cannot be reached.
    pub fn receive(&self) -> Result<Option<Received<H, E>>, TransportError> {
        let sample = self.reader.receive(|port| port.receive())?;
        Ok(sample.map(|sample| Received { sample }))
    }
}

impl<H: Message, E: Element> Received<H, E> {
    /// A copy of the header: what is checked must not change afterwards.
    pub fn header(&self) -> H {
        self.sample.user_header().0
    }

    /// The elements, in place. Their writer, a process of the same user, could still change them: it is
    /// trusted not to (`wire.rs`, where the types are), and each bit pattern is an element, so that one
    /// that does spoils numbers and no memory.
    pub fn payload(&self) -> &[E] {
        WireElement::peel_slice(self.sample.payload())
    }
}
