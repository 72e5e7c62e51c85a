//! Bulk data: a header and a slice, written in place and read in place.
#![expect(unsafe_code, reason = "a loan from shared memory is initialised by what it is")]

use crate::error::TransportError;
use crate::wire::{Wire, WireElement};
use bytemuck::TransparentWrapper;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use iceoryx2::sample_mut::SampleMut;
use tessera_messages::{Element, Message};

/// Writes messages of a header and a slice.
#[derive(Debug)]
pub struct SlicePublisher<H: Message, E: Element> {
    pub(crate) port: Publisher<ipc::Service, [WireElement<E>], Wire<H>>,
    pub(crate) service: &'static str,
}

/// A message in the making, in shared memory.
#[derive(Debug)]
pub struct Loan<H: Message, E: Element> {
    sample: SampleMut<ipc::Service, [WireElement<E>], Wire<H>>,
    service: &'static str,
}

impl<H: Message, E: Element> SlicePublisher<H, E> {
    /// Borrows room for a message of `len` elements; they hold whatever was there before.
    ///
    /// # Errors
    /// Where `len` is above the service's limit or all loans are out.
    pub fn loan(&self, len: usize) -> Result<Loan<H, E>, TransportError> {
        let sample = self.port.loan_slice_uninit(len).map_err(|e| TransportError::Message {
            action: "borrow room",
            service: self.service,
            reason: format!("{e:?} for {len} elements"),
        })?;
        // SAFETY: the bytes lie in a mapped shared memory object, which the kernel has zeroed or
        // an earlier message has written; every bit pattern is a value of a `Pod` element.
        let sample = unsafe { sample.assume_init() };
        Ok(Loan { sample, service: self.service })
    }

    /// Gives late readers their history; to be called now and then by a writer that is idle.
    pub fn update(&self) {
        let _ = self.port.update_connections();
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
    /// Where iceoryx2 cannot; a service without a reader is no error.
    pub fn send(self) -> Result<(), TransportError> {
        self.sample.send().map(drop).map_err(|e| TransportError::Message {
            action: "send",
            service: self.service,
            reason: format!("{e:?}"),
        })
    }
}

/// Reads messages of a header and a slice.
#[derive(Debug)]
pub struct SliceSubscriber<H: Message, E: Element> {
    pub(crate) port: Subscriber<ipc::Service, [WireElement<E>], Wire<H>>,
    pub(crate) service: &'static str,
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
    /// Where too many messages are held, or a connection is broken.
    pub fn receive(&self) -> Result<Option<Received<H, E>>, TransportError> {
        match self.port.receive() {
            Ok(sample) => Ok(sample.map(|sample| Received { sample })),
            Err(e) => Err(TransportError::Message {
                action: "receive",
                service: self.service,
                reason: format!("{e:?}"),
            }),
        }
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
