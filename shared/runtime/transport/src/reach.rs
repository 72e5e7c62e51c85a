//! Partners that a port could not be connected with.
//!
//! iceoryx2 0.10 connects a port when the list of its partners has changed, and only then. Where a connection cannot
//! be made, for want of memory or descriptors, it logs a warning and takes the change as seen (`update_connection` in
//! its `port/details/receiver.rs` and `sender.rs`): a reader then hears nothing of a writer for as long as both live.
//! So each port notes the partners that it missed; that a living one is among them is an error.

use crate::error::TransportError;
use iceoryx2::identifiers::UniqueNodeId;
use iceoryx2::port::{DegradationAction, DegradationCause, DegradationFn, DegradationInfo};
use iceoryx2::prelude::{CallbackProgression, Config, IceoryxSend, Node, NodeState, ZeroCopySend, ipc};
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;
use std::fmt::Debug;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A service, and whom a port of it has missed.
#[derive(Debug)]
pub(crate) struct ServiceReach<P, H>
where
    P: IceoryxSend + Debug + ?Sized + 'static,
    H: ZeroCopySend + Debug + 'static,
{
    pub(crate) factory: PortFactory<ipc::Service, P, H>,
    pub(crate) service: &'static str,
    config: Config,
    /// That a living partner was missed is no error.
    pub(crate) is_tolerant: bool,
    /// Ids of ports.
    missed: Arc<Mutex<Vec<u128>>>,
}

impl<P, H> ServiceReach<P, H>
where
    P: IceoryxSend + Debug + ?Sized + 'static,
    H: ZeroCopySend + Debug + 'static,
{
    pub(crate) fn new(
        factory: PortFactory<ipc::Service, P, H>,
        service: &'static str,
        config: &Config,
    ) -> Self {
        Self { factory, service, config: config.clone(), is_tolerant: false, missed: Arc::default() }
    }

    /// For a service whose partners are observers: none of them may end a stage, nor a stage one of them.
    pub(crate) fn tolerant_if(mut self, is_tolerant: bool) -> Self {
        self.is_tolerant = is_tolerant;
        self
    }

    /// What a new reader calls where it misses a writer; what was missed before it is forgotten.
    pub(crate) fn reader_handler(&self) -> impl DegradationFn + 'static {
        self.handler(|info| info.sender_port_id)
    }

    /// What a new writer calls where it misses a reader; what was missed before it is forgotten.
    pub(crate) fn writer_handler(&self) -> impl DegradationFn + 'static {
        self.handler(|info| info.receiver_port_id)
    }

    fn handler(&self, partner: fn(&DegradationInfo) -> u128) -> impl DegradationFn + 'static {
        lock(&self.missed).clear();
        let missed = Arc::clone(&self.missed);
        move |cause: DegradationCause, info: &DegradationInfo| match cause {
            DegradationCause::FailedToEstablishConnection => {
                let (mut missed, id) = (lock(&missed), partner(info));
                // It is tried again, and missed again, with each change of the list.
                if !missed.contains(&id) {
                    missed.push(id);
                }
                DegradationAction::Ignore
            }
            DegradationCause::ConnectionCorrupted => DegradationAction::Warn,
        }
    }

    /// Whether a partner was missed, dead or alive.
    pub(crate) fn has_missed(&self) -> bool {
        !lock(&self.missed).is_empty()
    }

    /// Checks that no living writer was missed.
    ///
    /// # Errors
    /// [`TransportError::Unreached`], also at the next call.
    pub(crate) fn check_writers(&self) -> Result<(), TransportError> {
        self.check(|id| {
            let mut node = None;
            self.factory.dynamic_config().list_publishers(|details| {
                node = node.or((details.publisher_id.value() == id).then_some(details.node_id));
                CallbackProgression::Continue
            });
            node
        })
    }

    /// Checks that no living reader was missed; to be called after whatever connects a writer.
    ///
    /// # Errors
    /// [`TransportError::Unreached`], also at the next call.
    pub(crate) fn check_readers(&self) -> Result<(), TransportError> {
        if self.is_tolerant || !self.has_missed() {
            return Ok(());
        }
        self.check(|id| {
            let mut node = None;
            self.factory.dynamic_config().list_subscribers(|details| {
                node = node.or((details.subscriber_id.value() == id).then_some(details.node_id));
                CallbackProgression::Continue
            });
            node
        })
    }

    /// Forgets the partners that are gone: of one that has died its files go before its place in the list, and that
    /// it cannot be reached meanwhile is right.
    fn check(&self, node_of: impl Fn(u128) -> Option<UniqueNodeId>) -> Result<(), TransportError> {
        let mut missed = lock(&self.missed);
        missed.retain(|id| node_of(*id).is_some_and(|node| self.may_live(node)));
        if missed.is_empty() || self.is_tolerant { Ok(()) } else { Err(self.unreached()) }
    }

    pub(crate) fn unreached(&self) -> TransportError {
        TransportError::Unreached { service: self.service }
    }

    /// Whether a process lives, or that is not known.
    fn may_live(&self, node: UniqueNodeId) -> bool {
        let state = Node::<ipc::Service>::state_of(&self.config, node);
        !matches!(state, Ok(None | Some(NodeState::Dead(_))))
    }
}

fn lock(missed: &Mutex<Vec<u128>>) -> MutexGuard<'_, Vec<u128>> {
    missed.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cleanup::shared_memory_files;
    use crate::identity::RunIdentity;
    use crate::layout::Layout;
    use crate::link::Link;
    use crate::registry::RunClaim;
    use std::os::unix::fs::PermissionsExt;
    use std::path::PathBuf;
    use tessera_messages::{Beat, Flow, FrameShape};
    use tessera_surface::Grid;

    const LAYOUT: Layout = Layout {
        frame: FrameShape { width: 64, height: 48 },
        grid: Grid { width: 16, height: 12, step: 4 },
        window: 2,
        recent: 2,
        ahead: 2,
        live: false,
        external: false,
    };

    fn join(test: &str) -> (tempfile::TempDir, RunClaim, Link) {
        let dir = tempfile::tempdir().unwrap();
        let claim = RunClaim::take(&format!("test-{test}-{}", std::process::id()), dir.path()).unwrap();
        let link = Link::open(&claim.entry.identity, &LAYOUT, "test").unwrap();
        (dir, claim, link)
    }

    /// Files that are there after `make`, and were not before.
    fn made_by<T>(identity: &RunIdentity, extension: &str, make: impl FnOnce() -> T) -> (T, PathBuf) {
        let before = shared_memory_files(identity);
        let made = make();
        let mut new = shared_memory_files(identity);
        new.retain(|path| !before.contains(path) && path.extension().is_some_and(|e| e == extension));
        assert_eq!(new.len(), 1, "{new:?}");
        (made, new.remove(0))
    }

    fn is_unreached<T: Debug>(result: Result<T, TransportError>, of: &str) -> bool {
        matches!(result.unwrap_err(), TransportError::Unreached { service } if service == of)
    }

    /// What a reader out of memory sees: it cannot map the new writer's segment.
    #[test]
    fn a_writer_that_cannot_be_reached_is_told_and_heard_later() {
        let (_dir, claim, link) = join("reach-reader");
        let identity = &claim.entry.identity;
        let (flows, beats) = (link.flow_subscriber().unwrap(), link.beat_subscriber().unwrap());
        let (flow, flow_segment) = made_by(identity, "data", || link.flow_publisher().unwrap());
        let (beat, beat_segment) = made_by(identity, "data", || link.beat_publisher().unwrap());
        let segments = [flow_segment, beat_segment];
        let hidden = segments.clone().map(|path| path.with_extension("hidden"));
        for (from, to) in segments.iter().zip(&hidden) {
            std::fs::rename(from, to).unwrap();
        }
        flow.send(Flow { acknowledged: 7, ..Flow::default() }).unwrap();
        beat.send(Beat { sequence: 7, ..Beat::default() }).unwrap();
        for _ in 0..2 {
            assert!(is_unreached(flows.receive(), "flow"));
            // Beats are for observers.
            assert!(beats.receive().unwrap().is_none());
        }
        for (from, to) in hidden.iter().zip(&segments) {
            std::fs::rename(from, to).unwrap();
        }
        assert!(flows.receive().unwrap().is_none() && beats.receive().unwrap().is_none());
        flow.update().unwrap();
        beat.update().unwrap();
        assert_eq!(flows.receive().unwrap().unwrap().acknowledged, 7);
        assert_eq!(beats.receive().unwrap().unwrap().sequence, 7);
        drop((flows, beats, flow, beat, link));
        claim.release().unwrap();
    }

    #[test]
    fn a_reader_that_cannot_be_reached_is_told() {
        let (_dir, claim, link) = join("reach-writer");
        let flow = link.flow_publisher().unwrap();
        let (flows, connection) =
            made_by(&claim.entry.identity, "connection", || link.flow_subscriber().unwrap());
        let set_mode = |mode| {
            std::fs::set_permissions(&connection, std::fs::Permissions::from_mode(mode)).unwrap();
        };
        set_mode(0o200);
        assert!(is_unreached(flow.update(), "flow"));
        assert!(is_unreached(flow.send(Flow::default()), "flow"));
        set_mode(0o600);
        drop(flows);
        // It is gone, and is missed no more.
        flow.update().unwrap();
        flow.send(Flow::default()).unwrap();
        drop((flow, link));
        claim.release().unwrap();
    }

    const RUN: &str = "TESSERA_TEST_RUN";

    /// iceoryx2 0.10 lets a failed connection keep the key of the one before it, and drops by it another.
    #[test]
    fn a_dead_writer_that_is_missed_takes_no_living_one_with_it() {
        if let Ok(identity) = std::env::var(RUN) {
            // The writer that dies.
            let link = Link::open(&serde_json::from_str(&identity).unwrap(), &LAYOUT, "dies").unwrap();
            let _beat = link.beat_publisher().unwrap();
            std::process::abort();
        }
        let (_dir, claim, link) = join("reach-dead");
        let identity = &claim.entry.identity;
        let beats = link.beat_subscriber().unwrap();
        let first = link.beat_publisher().unwrap();
        assert!(beats.receive().unwrap().is_none());
        drop(first);
        let name = "reach::tests::a_dead_writer_that_is_missed_takes_no_living_one_with_it";
        let ((), segment) = made_by(identity, "data", || {
            let mut dies = std::process::Command::new(std::env::current_exe().unwrap());
            let dies = dies.args(["--exact", name]).env(RUN, serde_json::to_string(identity).unwrap());
            assert!(!dies.output().unwrap().status.success());
        });
        // As a clean-up does, before it frees the dead one's place.
        std::fs::remove_file(segment).unwrap();
        let beat = link.beat_publisher().unwrap();
        let send = |sequence| beat.send(Beat { sequence, ..Beat::default() }).unwrap();
        let newest = || beats.newest().unwrap().map(|beat| beat.sequence);
        send(1);
        assert_eq!(beats.receive().unwrap().unwrap().sequence, 1);
        send(2);
        let _another = link.beat_publisher().unwrap();
        assert_eq!(newest(), Some(2));
        send(3);
        assert_eq!(newest(), Some(3), "the connection with the living writer was dropped");
        drop((beats, beat, _another, link));
        claim.release().unwrap();
    }
}
