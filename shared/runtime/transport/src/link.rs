//! A process's place in a run: its node, and how ports are made by the table.

use crate::cleanup::{Cleaned, clean_dead_nodes};
use crate::error::TransportError;
use crate::identity::RunIdentity;
use crate::layout::{Layout, Service, slice_type};
use crate::messages::{Publisher, Subscriber};
use crate::node::{VisitedRun, open_node};
use crate::patience::{patiently, service_name};
use crate::reach::ServiceReach;
use crate::reader::ReaderPort;
use crate::slices::{SlicePublisher, SliceSubscriber};
use crate::wake::{Listener, Notifier};
use crate::wire::{Wire, WireElement};
use crate::writer::WriterPort;
use iceoryx2::prelude::{AllocationStrategy, Config, IceoryxSend, Node, ZeroCopySend, ipc};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::fmt::Debug;
use tessera_messages::{
    Beat, CameraFlow, CameraFrame, Element, Flow, FrameHeader, Message, PoseMessage, Stage, StageTimes,
    SurfaceHeader,
};
use tessera_surface::Vertex;

/// A node in a run's shared memory. Single-threaded, as its ports are.
#[derive(Debug)]
pub struct Link {
    node: Node<ipc::Service>,
    config: Config,
    identity: RunIdentity,
    pub(crate) layout: Layout,
    /// Dropped last.
    _run: VisitedRun,
}

type SliceService<H, E> = PortFactory<ipc::Service, [WireElement<E>], Wire<H>>;
type MessageService<T> = PortFactory<ipc::Service, Wire<T>, ()>;

type EventService = iceoryx2::service::port_factory::event::PortFactory<ipc::Service>;

/// All services of a run, kept open by its supervisor.
///
/// A process that is killed while it *creates* a service leaves half of one, which no process can
/// open or create any more. So the supervisor creates them all before a stage starts.
#[derive(Debug)]
pub struct HeldServices {
    _frames: SliceService<FrameHeader, u16>,
    _surfaces: SliceService<SurfaceHeader, Vertex>,
    _poses: MessageService<PoseMessage>,
    _flow: MessageService<Flow>,
    _beats: MessageService<Beat>,
    _stage_times: MessageService<StageTimes>,
    _events: Vec<EventService>,
    _camera: Option<CameraServices>,
}

/// What a camera's own program finds, for as long as this is kept.
#[derive(Debug)]
pub struct CameraServices {
    _camera: SliceService<CameraFrame, u16>,
    _camera_flow: MessageService<CameraFlow>,
}

impl Link {
    /// Creates all services of the run, for as long as the answer is kept.
    ///
    /// # Errors
    /// Where a service cannot be created.
    pub fn hold_services(&self) -> Result<HeldServices, TransportError> {
        Ok(HeldServices {
            _frames: self.slice_service(&self.layout.frames())?,
            _surfaces: self.slice_service(&self.layout.surfaces())?,
            _poses: self.message_service(&self.layout.poses())?,
            _flow: self.message_service(&self.layout.flow())?,
            _beats: self.message_service(&self.layout.beats())?,
            _stage_times: self.message_service(&self.layout.stage_times())?,
            _events: Stage::ALL
                .into_iter()
                .map(|stage| self.event_service(stage))
                .collect::<Result<_, _>>()?,
            _camera: if self.layout.external { Some(self.hold_camera_services()?) } else { None },
        })
    }

    /// Creates the services for a camera's own program, for as long as the answer is kept.
    ///
    /// # Errors
    /// Where a service cannot be created.
    pub fn hold_camera_services(&self) -> Result<CameraServices, TransportError> {
        Ok(CameraServices {
            _camera: self.slice_service(&self.layout.camera())?,
            _camera_flow: self.message_service(&self.layout.camera_flow())?,
        })
    }

    /// Joins a run under a name that tools show.
    ///
    /// # Errors
    /// Where the run's configuration is missing or no node can be made.
    pub fn open(identity: &RunIdentity, layout: &Layout, name: &str) -> Result<Self, TransportError> {
        let (node, config, run) = open_node(identity, name)?;
        Ok(Self { node, config, identity: identity.clone(), layout: *layout, _run: run })
    }

    /// The sizes of this run's services.
    pub fn layout(&self) -> &Layout {
        &self.layout
    }

    /// Removes what dead processes of this run left.
    pub fn clean_dead_nodes(&self) -> Cleaned {
        clean_dead_nodes(&self.config, &self.identity)
    }

    fn slice_service<H: Message, E: Element>(
        &self,
        row: &Service,
    ) -> Result<SliceService<H, E>, TransportError> {
        let name = service_name(row.name)?;
        let what = format!("service {} of {}", row.name, slice_type::<H, E>());
        patiently(&what, Some(&self.node), || {
            self.node
                .service_builder(&name)
                .publish_subscribe::<[WireElement<E>]>()
                .user_header::<Wire<H>>()
                .max_publishers(row.publishers)
                .max_subscribers(row.subscribers)
                .max_nodes(24)
                .history_size(row.history)
                .subscriber_max_buffer_size(row.buffer)
                .subscriber_max_borrowed_samples(row.borrowed)
                .enable_safe_overflow(true)
                .open_or_create()
        })
    }

    fn message_service<T: Message>(&self, row: &Service) -> Result<MessageService<T>, TransportError> {
        let name = service_name(row.name)?;
        patiently(&format!("service {} of {}", row.name, T::NAME), Some(&self.node), || {
            self.node
                .service_builder(&name)
                .publish_subscribe::<Wire<T>>()
                .max_publishers(row.publishers)
                .max_subscribers(row.subscribers)
                .max_nodes(24)
                .history_size(row.history)
                .subscriber_max_buffer_size(row.buffer)
                .subscriber_max_borrowed_samples(row.borrowed)
                .enable_safe_overflow(true)
                .open_or_create()
        })
    }

    fn reach<P, H>(&self, row: &Service, factory: PortFactory<ipc::Service, P, H>) -> ServiceReach<P, H>
    where
        P: IceoryxSend + Debug + ?Sized + 'static,
        H: ZeroCopySend + Debug + 'static,
    {
        ServiceReach::new(factory, row.name, &self.config).tolerant_if(row.is_observed)
    }

    pub(crate) fn slice_publisher<H: Message, E: Element>(
        &self,
        row: &Service,
        max_len: usize,
    ) -> Result<SlicePublisher<H, E>, TransportError> {
        let reach = self.reach(row, self.slice_service::<H, E>(row)?);
        let writer = WriterPort::open(reach, Some(&self.node), |builder| {
            builder
                .max_loaned_samples(row.loans)
                .initial_max_slice_len(max_len)
                .allocation_strategy(AllocationStrategy::Static)
        })?;
        Ok(SlicePublisher { writer })
    }

    pub(crate) fn slice_subscriber<H: Message, E: Element>(
        &self,
        row: &Service,
    ) -> Result<SliceSubscriber<H, E>, TransportError> {
        let reach = self.reach(row, self.slice_service::<H, E>(row)?);
        Ok(SliceSubscriber { reader: ReaderPort::open(reach, Some(&self.node))? })
    }

    pub(crate) fn publisher<T: Message>(&self, row: &Service) -> Result<Publisher<T>, TransportError> {
        let reach = self.reach(row, self.message_service::<T>(row)?);
        let writer =
            WriterPort::open(reach, Some(&self.node), |builder| builder.max_loaned_samples(row.loans))?;
        Ok(Publisher { writer })
    }

    pub(crate) fn subscriber<T: Message>(&self, row: &Service) -> Result<Subscriber<T>, TransportError> {
        let reach = self.reach(row, self.message_service::<T>(row)?);
        Ok(Subscriber { reader: ReaderPort::open(reach, Some(&self.node))? })
    }

    /// A notifier that wakes a stage.
    ///
    /// # Errors
    /// Where the event cannot be opened.
    pub fn notifier(&self, stage: Stage) -> Result<Notifier, TransportError> {
        let service = self.event_service(stage)?;
        let what = format!("a notifier of {stage}");
        let port = patiently(&what, Some(&self.node), || service.notifier_builder().create())?;
        Ok(Notifier { port })
    }

    /// The listener on which a stage sleeps.
    ///
    /// # Errors
    /// Where the event cannot be opened.
    pub fn listener(&self, stage: Stage) -> Result<Listener, TransportError> {
        let service = self.event_service(stage)?;
        let what = format!("the listener of {stage}");
        let port = patiently(&what, Some(&self.node), || service.listener_builder().create())?;
        Ok(Listener { port })
    }

    fn event_service(&self, stage: Stage) -> Result<EventService, TransportError> {
        let name = Layout::event_name(stage);
        let service_name = service_name(&name)?;
        patiently(&format!("event {name}"), Some(&self.node), || {
            self.node.service_builder(&service_name).event().open_or_create()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::registry::RunClaim;
    use crate::space::shared_memory_in_use;
    use std::time::Duration;
    use tessera_messages::FrameShape;
    use tessera_surface::Grid;

    fn layout() -> Layout {
        Layout {
            frame: FrameShape { width: 64, height: 48 },
            grid: Grid { width: 16, height: 12, step: 4 },
            window: 2,
            recent: 2,
            ahead: 2,
            live: false,
            external: false,
        }
    }

    /// Whether an address lies in shared memory of that prefix.
    fn is_shared(address: usize, prefix: &str) -> bool {
        let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
        maps.lines().filter(|line| line.contains(&format!("/dev/shm/{prefix}"))).any(|line| {
            let (from, to) = line.split_whitespace().next().unwrap().split_once('-').unwrap();
            let parse = |text: &str| usize::from_str_radix(text, 16).unwrap();
            (parse(from)..parse(to)).contains(&address)
        })
    }

    #[test]
    fn a_message_is_written_and_read_in_one_place_and_nothing_stays() {
        let dir = tempfile::tempdir().unwrap();
        let claim = RunClaim::take(&format!("test-link-{}", std::process::id()), dir.path()).unwrap();
        let identity = claim.entry.identity.clone();
        let link = Link::open(&identity, &layout(), "test").unwrap();
        let publisher = link.frame_publisher().unwrap();
        let len = layout().frame.payload_len();
        let send = |index: u64| {
            let mut loan = publisher.loan(len).unwrap();
            loan.header_mut().index = index;
            loan.payload_mut()[5] = 500 + index as u16;
            loan.send().unwrap();
        };
        (0..3).for_each(send);
        // A late reader gets the history; what overflows is the oldest.
        let subscriber = link.frame_subscriber().unwrap();
        publisher.update().unwrap();
        (3..6).for_each(send);
        let first = subscriber.receive().unwrap().unwrap();
        assert_eq!((first.header().index, first.payload()[5]), (2, 502));
        let second = subscriber.receive().unwrap().unwrap();
        assert_eq!((second.header().index, second.payload().len()), (3, len));
        assert!(publisher.loan(len + 1).is_err());
        // Nothing was copied: what is read lies in the segment, and so does what is written.
        assert!(is_shared(second.payload().as_ptr() as usize, &identity.prefix));
        assert!(is_shared(publisher.loan(len).unwrap().payload_mut().as_ptr() as usize, &identity.prefix));
        drop(first);
        assert_eq!(subscriber.receive().unwrap().unwrap().header().index, 4);

        let (notifier, listener) =
            (link.notifier(Stage::Align).unwrap(), link.listener(Stage::Align).unwrap());
        assert!(!listener.wait(Duration::from_millis(1)).unwrap());
        notifier.notify();
        assert!(listener.wait(Duration::from_secs(5)).unwrap());

        let flow = link.flow_publisher().unwrap();
        let reader = link.flow_subscriber().unwrap();
        for acknowledged in 0..5 {
            flow.send(Flow { acknowledged, ..Flow::default() }).unwrap();
        }
        assert_eq!(reader.newest().unwrap().unwrap().acknowledged, 4);
        assert!(shared_memory_in_use(&identity) > 0);
        use std::os::unix::fs::PermissionsExt;
        for path in crate::cleanup::shared_memory_files(&identity) {
            let mode = std::fs::metadata(&path).unwrap().permissions().mode();
            assert_eq!(mode & 0o077, 0, "{} has mode {mode:o}", path.display());
        }
        drop((second, subscriber, publisher, flow, reader, notifier, listener));
        drop(link);
        claim.release().unwrap();
        assert!(crate::cleanup::shared_memory_files(&identity).is_empty());
    }
}
