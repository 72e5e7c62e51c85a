//! The public services for a program that is no process of the run: a camera's own program, or one
//! that reads poses. It opens what the run has made and creates nothing.

use crate::error::TransportError;
use crate::identity::RunIdentity;
use crate::layout::Layout;
use crate::messages::Subscriber;
use crate::node::{VisitedRun, open_node};
use crate::patience::{patiently, service_name};
use crate::reach::ServiceReach;
use crate::reader::ReaderPort;
use crate::slices::SlicePublisher;
use crate::wake::Notifier;
use crate::wire::{Wire, WireElement};
use crate::writer::WriterPort;
use iceoryx2::prelude::{AllocationStrategy, Config, MessagingPattern, Node, Service, ipc};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use tessera_messages::{CameraFlow, CameraFrame, FrameShape, Message, PoseMessage, Stage};

const CAMERA: &str = "camera";
const CAMERA_FLOW: &str = "camera_flow";
const POSES: &str = "poses";

/// A foreign program's node in a run's shared memory. Single-threaded, as its ports are.
#[derive(Debug)]
pub struct Guest {
    node: Node<ipc::Service>,
    config: Config,
    /// Dropped last.
    _run: VisitedRun,
}

impl Guest {
    /// Joins a run under a name that tools show.
    ///
    /// # Errors
    /// Where the run's configuration is missing or no node can be made.
    pub fn open(identity: &RunIdentity, name: &str) -> Result<Self, TransportError> {
        let (node, config, run) = open_node(identity, name)?;
        Ok(Self { node, config, _run: run })
    }

    /// Writes images of at most that size; `None` where the run has not made the service (yet).
    ///
    /// # Errors
    /// Where the service cannot be opened.
    pub fn camera_publisher(
        &self,
        shape: FrameShape,
    ) -> Result<Option<SlicePublisher<CameraFrame, u16>>, TransportError> {
        if !self.is_made(CAMERA)? {
            return Ok(None);
        }
        let name = service_name(CAMERA)?;
        let service = patiently("the service camera", None, || {
            self.node
                .service_builder(&name)
                .publish_subscribe::<[WireElement<u16>]>()
                .user_header::<Wire<CameraFrame>>()
                .open()
        })?;
        let writer = WriterPort::open(ServiceReach::new(service, CAMERA, &self.config), None, |builder| {
            builder
                .max_loaned_samples(1)
                .initial_max_slice_len(shape.payload_len())
                .allocation_strategy(AllocationStrategy::Static)
        })?;
        Ok(Some(SlicePublisher { writer }))
    }

    /// Reads what a camera's program is told; `None` where the run has not made the service (yet).
    ///
    /// # Errors
    /// Where the service cannot be opened.
    pub fn camera_flow_subscriber(&self) -> Result<Option<Subscriber<CameraFlow>>, TransportError> {
        self.subscriber(CAMERA_FLOW)
    }

    /// Reads poses; `None` where the run has not made the service (yet): it does so after the
    /// camera's first image.
    ///
    /// # Errors
    /// Where the service cannot be opened.
    pub fn pose_subscriber(&self) -> Result<Option<Subscriber<PoseMessage>>, TransportError> {
        self.subscriber(POSES)
    }

    /// Wakes the sensor after an image was sent; `None` where the run has not made the event (yet).
    ///
    /// # Errors
    /// Where the event cannot be opened.
    pub fn sensor_notifier(&self) -> Result<Option<Notifier>, TransportError> {
        let name = Layout::event_name(Stage::Sensor);
        if !self.exists(&name, MessagingPattern::Event)? {
            return Ok(None);
        }
        let service_name = service_name(&name)?;
        let service = patiently(&format!("event {name}"), None, || {
            self.node.service_builder(&service_name).event().open()
        })?;
        let port = patiently("a notifier of sensor", None, || service.notifier_builder().create())?;
        Ok(Some(Notifier { port }))
    }

    fn subscriber<T: Message>(&self, name: &'static str) -> Result<Option<Subscriber<T>>, TransportError> {
        if !self.is_made(name)? {
            return Ok(None);
        }
        let service_name = service_name(name)?;
        let service: PortFactory<ipc::Service, Wire<T>, ()> =
            patiently(&format!("service {name} of {}", T::NAME), None, || {
                self.node.service_builder(&service_name).publish_subscribe::<Wire<T>>().open()
            })?;
        // A guest tries again for as long as the run is there.
        let reach = ServiceReach::new(service, name, &self.config).tolerant_if(true);
        let reader = ReaderPort::open(reach, None)?;
        Ok(Some(Subscriber { reader }))
    }

    fn is_made(&self, name: &str) -> Result<bool, TransportError> {
        self.exists(name, MessagingPattern::PublishSubscribe)
    }

    fn exists(&self, name: &str, pattern: MessagingPattern) -> Result<bool, TransportError> {
        ipc::Service::does_exist(&service_name(name)?, &self.config, pattern).map_err(|error| {
            TransportError::Open { what: format!("service {name}"), reason: format!("{error:?}") }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cleanup::shared_memory_files;
    use crate::link::Link;
    use crate::registry::RunClaim;
    use tessera_messages::FrameShape;
    use tessera_surface::Grid;

    #[test]
    fn a_guest_of_a_run_that_is_gone_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let claim = RunClaim::take(&format!("test-left-{}", std::process::id()), dir.path()).unwrap();
        let identity = claim.entry.identity.clone();
        let config = std::fs::read(&identity.config_file).unwrap();
        let guest = Guest::open(&identity, "guest").unwrap();
        claim.release().unwrap();
        drop(guest);
        assert_eq!(shared_memory_files(&identity), Vec::<std::path::PathBuf>::new());
        // The run was over before its node was made, and its configuration goes while the guest is there.
        std::fs::create_dir_all(identity.config_file.parent().unwrap()).unwrap();
        std::fs::write(&identity.config_file, config).unwrap();
        let guest = Guest::open(&identity, "guest").unwrap();
        assert!(!shared_memory_files(&identity).is_empty());
        std::fs::remove_file(&identity.config_file).unwrap();
        drop(guest);
        assert_eq!(shared_memory_files(&identity), Vec::<std::path::PathBuf>::new());
        assert!(!identity.root.exists());
    }

    #[test]
    fn a_guest_opens_what_is_made_and_creates_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let claim = RunClaim::take(&format!("test-guest-{}", std::process::id()), dir.path()).unwrap();
        let guest = Guest::open(&claim.entry.identity, "guest").unwrap();
        let frame = FrameShape { width: 8, height: 6 };
        assert!(
            guest.camera_publisher(frame).unwrap().is_none() && guest.pose_subscriber().unwrap().is_none()
        );
        assert!(guest.sensor_notifier().unwrap().is_none());
        let grid = Grid { width: 0, height: 0, step: 1 };
        let layout = Layout { frame, grid, window: 3, recent: 0, ahead: 3, live: true, external: true };
        let link = Link::open(&claim.entry.identity, &layout, "test").unwrap();
        let _services = link.hold_camera_services().unwrap();
        let (images, flow) = (link.camera_subscriber().unwrap(), link.camera_flow_publisher().unwrap());
        let listener = link.listener(Stage::Sensor).unwrap();
        let camera = guest.camera_publisher(frame).unwrap().unwrap();
        let told = guest.camera_flow_subscriber().unwrap().unwrap();
        flow.send(CameraFlow { epoch: 5, ..CameraFlow::default() }).unwrap();
        assert_eq!(told.newest().unwrap().unwrap().epoch, 5);
        let mut loan = camera.loan(frame.n_pixels()).unwrap();
        loan.header_mut().index = 7;
        loan.payload_mut().fill(9);
        loan.send().unwrap();
        guest.sensor_notifier().unwrap().unwrap().notify();
        assert!(listener.wait(std::time::Duration::from_secs(5)).unwrap());
        let image = images.receive().unwrap().unwrap();
        assert_eq!((image.header().index, image.payload()), (7, &[9; 48][..]));
        assert!(guest.pose_subscriber().unwrap().is_none());
        drop((image, images, flow, listener, camera, told, guest, _services, link));
        claim.release().unwrap();
    }
}
