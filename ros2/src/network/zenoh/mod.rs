//! Zenoh as rmw_zenoh has it: keys, attachments and tokens of its making, over a session that learns of
//! others from a router.

mod arrivals;
mod attachment;
mod config;
mod ends;
mod graph;
mod keys;
mod service;

use crate::carrier::{
    Carrier, CarrierError, NodeName, Publication, Quality, RosType, Seen, Server, Service, Subscription,
};
use crate::error::Ros2Error;
use crate::network::open::Waiting;
use crate::network::reach::Ros2Network;
use arrivals::ZenohArrivals;
use config::{Configuration, configuration};
use ends::{Notes, ZenohReader, ZenohWriter};
use graph::RosGraph;
use keys::{ANY, EndKind, Tokens, ZenohEnd, hash, key};
use service::ZenohServer;
use std::collections::BTreeSet;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use zenoh::liveliness::LivelinessToken;
use zenoh::{Config, Session, Wait};

/// Time for which the router is waited for before it is said that there is none.
const PATIENCE: Duration = Duration::from_secs(1);
const POLL: Duration = Duration::from_millis(20);
/// Time between two lines that say so.
const INTERVAL: Duration = Duration::from_secs(5);

/// A session, and which ends it has.
pub(crate) struct Zenoh {
    session: Session,
    network: Ros2Network,
    name: NodeName,
    routers: String,
    routers_from: String,
    graph: RosGraph,
    ends: Vec<ZenohEnd>,
    notes: Notes,
    arrivals: Arc<ZenohArrivals>,
    /// That of the node.
    _token: LivelinessToken,
}

fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

fn wrong(action: &str, reason: &dyn std::fmt::Display) -> CarrierError {
    CarrierError { action: action.to_owned(), reason: reason.to_string() }
}

impl Zenoh {
    /// Joins a domain as a node of that name. A router that is not there yet is joined when it comes.
    ///
    /// # Errors
    /// Where the configuration cannot be used, or an address cannot be had.
    pub(crate) fn open(
        network: &Ros2Network,
        name: NodeName,
        waiting: &Waiting<'_>,
    ) -> Result<Self, Ros2Error> {
        let Configuration { config, routers, from } =
            configuration(network, |name| std::env::var(name).ok())?;
        let session = open_session(config, &routers, waiting)?;
        let began = Instant::now();
        while !has_router(&session) && began.elapsed() < PATIENCE {
            std::thread::sleep(POLL);
        }
        let graph = RosGraph::open(&session, network.domain)?;
        let id = session.zid().to_string();
        let token = Tokens { domain: network.domain, session: &id, name: &name }.node();
        let token = declare(&session, token)?;
        Ok(Self {
            session,
            network: network.clone(),
            name,
            routers,
            routers_from: from,
            graph,
            ends: Vec::new(),
            notes: Notes::default(),
            arrivals: Arc::default(),
            _token: token,
        })
    }

    /// Announces an end; its number and its token.
    fn announce(
        &mut self,
        kind: EndKind,
        (topic, of): (&str, RosType),
        quality: Quality,
    ) -> Result<(u32, LivelinessToken), CarrierError> {
        let hash = hash(of, self.name.is_humble).to_owned();
        let end = ZenohEnd { kind, topic: topic.to_owned(), of: of.in_dds(), hash, quality };
        // 0 is that of the node.
        let number = u32::try_from(self.ends.len()).unwrap_or(u32::MAX).saturating_add(1);
        let id = self.session.zid().to_string();
        let tokens = Tokens { domain: self.network.domain, session: &id, name: &self.name };
        let token = declare(&self.session, tokens.end(number, &end))?;
        self.ends.push(end);
        Ok((number, token))
    }

    /// Words where no router is there.
    fn missing_router(&self) -> Option<String> {
        (!has_router(&self.session)).then(|| no_router(&self.routers))
    }
}

fn no_router(routers: &str) -> String {
    format!(
        "no Zenoh router at {routers}: others are not found until it is there; ros2 run rmw_zenoh_cpp rmw_zenohd starts one"
    )
}

/// Opens a session. A client gets none before its router is there, or lets it in: that is told meanwhile.
fn open_session(config: Config, routers: &str, waiting: &Waiting<'_>) -> Result<Session, Ros2Error> {
    let (to, opened) = channel();
    std::thread::spawn(move || to.send(zenoh::open(config).wait()));
    let mut told = Instant::now();
    let mut patience = PATIENCE;
    loop {
        match opened.recv_timeout(POLL) {
            Ok(session) => return Ok(session.map_err(|error| wrong("join Zenoh", &error))?),
            Err(RecvTimeoutError::Disconnected) => return Err(wrong("join Zenoh", &"no answer").into()),
            Err(RecvTimeoutError::Timeout) => {}
        }
        if waiting.is_stopped.load(Ordering::Relaxed) {
            return Err(wrong("join Zenoh", &format!("ended while there was no router at {routers}")).into());
        }
        if told.elapsed() >= patience {
            (told, patience) = (Instant::now(), INTERVAL);
            waiting.report.say(&no_router(routers));
        }
    }
}

fn declare(session: &Session, token: String) -> Result<LivelinessToken, CarrierError> {
    let declared = session.liveliness().declare_token(token).wait();
    declared.map_err(|error| wrong("tell what is read and written", &error))
}

fn has_router(session: &Session) -> bool {
    session.info().routers_zid().wait().next().is_some()
}

impl Carrier for Zenoh {
    fn subscribe(
        &mut self,
        topic: &str,
        kind: RosType,
        quality: Quality,
    ) -> Result<Box<dyn Subscription>, CarrierError> {
        // Any hash: a writer of any distribution will do.
        let key = key(self.network.domain, topic, kind, ANY)?;
        let (_, token) = self.announce(EndKind::Reader, (topic, kind), quality)?;
        let with = (Notes::clone(&self.notes), Arc::clone(&self.arrivals));
        Ok(Box::new(ZenohReader::open(&self.session, (topic, key, token), quality, with)?))
    }

    fn publish(
        &mut self,
        topic: &str,
        kind: RosType,
        quality: Quality,
    ) -> Result<Box<dyn Publication>, CarrierError> {
        let key = key(self.network.domain, topic, kind, hash(kind, self.name.is_humble))?;
        let (number, token) = self.announce(EndKind::Writer, (topic, kind), quality)?;
        let identity = attachment::identity(self.session.zid().to_le_bytes(), number);
        Ok(Box::new(ZenohWriter::open(&self.session, (topic, key), quality, (token, identity))?))
    }

    fn serve(&mut self, name: &str, service: Service) -> Result<Box<dyn Server>, CarrierError> {
        let key = key(self.network.domain, name, service.kind, ANY)?;
        let (_, token) = self.announce(EndKind::Server, (name, service.kind), Quality::DEFAULT)?;
        Ok(Box::new(ZenohServer::open(&self.session, (name, key, service), token)?))
    }

    fn wait(&mut self, timeout: Duration) -> bool {
        self.arrivals.wait(timeout)
    }

    fn introduce(&mut self) -> Result<(), CarrierError> {
        // Each token was told when its end was made.
        Ok(())
    }

    fn seen(&self) -> Vec<Seen> {
        self.graph.seen()
    }

    fn read_topics(&self) -> BTreeSet<String> {
        self.graph.read_topics()
    }

    fn unmatched(&self) -> Vec<String> {
        let notes = std::mem::take(&mut *lock(&self.notes));
        let unmatched = self.graph.unmatched(&self.ends);
        self.missing_router().into_iter().chain(unmatched).chain(notes).collect()
    }

    fn words(&self) -> Vec<String> {
        let place = self.network.reach.words("127.0.0.1 alone");
        let (domain, routers, from) = (self.network.domain, &self.routers, &self.routers_from);
        let joined = format!(
            "Zenoh domain {domain}, router {routers} ({from}), listens on {place} ({})",
            self.network.from
        );
        [joined].into_iter().chain(self.missing_router()).collect()
    }
}
