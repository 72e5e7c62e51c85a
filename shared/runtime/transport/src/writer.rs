//! A publisher that tells where it missed a subscriber.

use crate::error::TransportError;
use crate::patience::patiently;
use crate::reach::ServiceReach;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::{IceoryxSend, Node, ZeroCopySend, ipc};
use iceoryx2::service::port_factory::publisher::PortFactoryPublisher;
use std::fmt::Debug;
use std::rc::Rc;

/// The writing end of a service.
///
/// It is not made anew where it missed a living reader: it holds the history, and loans that are out. Its process ends,
/// and the successor writes again what is not acknowledged.
#[derive(Debug)]
pub(crate) struct WriterPort<P, H>
where
    P: IceoryxSend + Debug + ?Sized + 'static,
    H: ZeroCopySend + Debug + 'static,
{
    pub(crate) port: Publisher<ipc::Service, P, H>,
    /// Loans tell it too.
    pub(crate) reach: Rc<ServiceReach<P, H>>,
}

impl<P, H> WriterPort<P, H>
where
    P: IceoryxSend + Debug + ?Sized + 'static,
    H: ZeroCopySend + Debug + 'static,
{
    /// Connects to all readers; `node`, where given, cleans up after dead writers where there is no place.
    ///
    /// # Errors
    /// Where there is no place, or a living reader cannot be reached.
    pub(crate) fn open(
        reach: ServiceReach<P, H>,
        node: Option<&Node<ipc::Service>>,
        build: impl Fn(
            PortFactoryPublisher<'_, ipc::Service, P, H>,
        ) -> PortFactoryPublisher<'_, ipc::Service, P, H>,
    ) -> Result<Self, TransportError> {
        let port = patiently(&format!("a publisher of {}", reach.service), node, || {
            let builder = build(reach.factory.publisher_builder());
            builder.set_degradation_handler(reach.writer_handler()).create()
        })?;
        let writer = Self { port, reach: Rc::new(reach) };
        writer.reach.check_readers()?;
        Ok(writer)
    }

    /// Gives late readers their history.
    ///
    /// # Errors
    /// Where a living reader cannot be reached.
    pub(crate) fn update(&self) -> Result<(), TransportError> {
        self.port.update_connections().map_err(|e| TransportError::Message {
            action: "connect",
            service: self.reach.service,
            reason: format!("{e:?}"),
        })?;
        self.reach.check_readers()
    }
}
