//! DDS, by RustDDS: messages pass as bytes, and what they mean is not its business.

mod announcement;
mod arrivals;
mod buffers;
mod destinations;
mod held_signals;
mod loops;
mod neighbours;
mod node;
mod own_sockets;
mod raw;
mod service;

use crate::carrier::{
    Carrier, CarrierError, NodeName, Publication, Quality, RosType, Seen, Server, Service, Subscription,
    from_dds,
};
use crate::network::reach::{NetworkReach, Ros2Network};
use arrivals::DdsArrivals;
use buffers::doubt_buffers;
use held_signals::HeldSignals;
use loops::Loops;
use neighbours::{Inside, Neighbours, multicast_port, unicast_port};
use node::{NodeEnds, RosNode};
use own_sockets::keep_to_loopback;
use raw::{DdsReader, DdsWriter};
use rustdds::discovery::{DiscoveredReaderData, DiscoveredWriterData};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, GUID, QosPolicies, QosPolicyBuilder, RTPSEntity,
    TopicKind,
};
use service::DdsServer;
use std::collections::BTreeSet;
use std::net::{IpAddr, Ipv4Addr};

/// Topics of ROS have this before their name, requests and replies of services these.
const PREFIX: &str = "rt";
const REQUEST_PREFIX: &str = "rq";
const REPLY_PREFIX: &str = "rr";
/// Time that a write may wait: none worth speaking of.
const MAX_BLOCKING: Duration = Duration::from_millis(10);

/// A participant, and which of its readers and writers there are.
pub(crate) struct Dds {
    participant: DomainParticipant,
    network: Ros2Network,
    readers: Vec<DdsEnd>,
    writers: Vec<DdsEnd>,
    node: RosNode,
    arrivals: DdsArrivals,
    /// Where the reach is this machine.
    neighbours: Option<Neighbours>,
    /// What may go wrong with its sockets.
    doubts: Vec<String>,
    loops: Loops,
}

/// A reader or writer: topic and type as DDS has them.
#[derive(Clone, Debug)]
struct DdsEnd {
    topic: String,
    kind: String,
    quality: Quality,
    guid: GUID,
}

impl Dds {
    /// Joins a domain as a node of that name.
    ///
    /// # Errors
    /// Where the sockets cannot be had.
    pub(crate) fn open(network: &Ros2Network, name: NodeName) -> Result<Self, CarrierError> {
        let mut doubts = Vec::new();
        let unheard = |error: &std::io::Error| {
            format!(
                "programs that find each other by multicast are not heard ({error}): --network all hears them"
            )
        };
        // Before the participant, which is alone in a domain of its own.
        let inside = match network.reach {
            NetworkReach::Loopback => {
                Inside::open(network.domain).inspect_err(|e| doubts.push(unheard(e))).ok()
            }
            NetworkReach::Interface(_) | NetworkReach::All => None,
        };
        let domain = inside.as_ref().map_or(network.domain, |inside| inside.inner);
        let builder = DomainParticipantBuilder::new(domain);
        let builder = match network.reach {
            NetworkReach::Loopback => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
            NetworkReach::Interface(address) => {
                builder.with_only_networks([address, IpAddr::V4(Ipv4Addr::LOCALHOST)])
            }
            NetworkReach::All => builder,
        };
        let held = HeldSignals::hold();
        let participant =
            builder.build().map_err(|error| wrong(&format!("join DDS domain {}", network.domain), &error))?;
        drop(held);
        let to = make_writer(&participant, node::TOPIC, (node::KIND, &Quality::LATCHED))?;
        let node = RosNode { name, to, told: Vec::new() };
        if network.reach == NetworkReach::Loopback
            && let Err(error) = keep_to_loopback()
        {
            doubts.push(format!(
                "its UDP ports are open to other networks too ({error}): close them with a firewall"
            ));
        }
        let prefix = participant.guid().to_bytes();
        let neighbours = match inside.map(|of| of.begin(participant.participant_id(), &prefix[..12])) {
            Some(Ok(neighbours)) => Some(neighbours),
            Some(Err(error)) => {
                return Err(wrong(&format!("join DDS domain {}", network.domain), &error));
            }
            None => None,
        };
        doubts.extend(doubt_buffers());
        let (network, arrivals) = (network.clone(), DdsArrivals::new()?);
        let (readers, writers) = (Vec::new(), Vec::new());
        Ok(Self {
            participant,
            network,
            readers,
            writers,
            node,
            arrivals,
            neighbours,
            doubts,
            loops: Loops::default(),
        })
    }

    fn reader(&mut self, topic: String, kind: RosType, quality: Quality) -> Result<DdsReader, CarrierError> {
        let kind = kind.in_dds();
        let (made, qos) = make_topic(&self.participant, &topic, (&kind, &quality))?;
        let action = format!("subscribe {topic}");
        let subscriber = self.participant.create_subscriber(&qos).map_err(|e| wrong(&action, &e))?;
        let created = subscriber.create_datareader_no_key(&made, Some(qos));
        let mut reader = created.map_err(|e| wrong(&action, &e))?;
        self.arrivals.watch(&mut reader)?;
        let reader = DdsReader { reader, topic: topic.clone() };
        self.readers.push(DdsEnd { topic, kind, quality, guid: reader.reader.guid() });
        Ok(reader)
    }

    fn writer(&mut self, topic: String, kind: RosType, quality: Quality) -> Result<DdsWriter, CarrierError> {
        let kind = kind.in_dds();
        let writer = make_writer(&self.participant, &topic, (&kind, &quality))?;
        self.writers.push(DdsEnd { topic, kind, quality, guid: writer.writer.guid() });
        Ok(writer)
    }
}

fn make_topic(
    participant: &DomainParticipant,
    name: &str,
    (kind, quality): (&str, &Quality),
) -> Result<(rustdds::Topic, QosPolicies), CarrierError> {
    let qos = qos(quality);
    let made = participant.create_topic(name.to_owned(), kind.to_owned(), &qos, TopicKind::NoKey);
    Ok((made.map_err(|error| wrong(&format!("make topic {name}"), &error))?, qos))
}

fn make_writer(
    participant: &DomainParticipant,
    name: &str,
    of: (&str, &Quality),
) -> Result<DdsWriter, CarrierError> {
    let (topic, qos) = make_topic(participant, name, of)?;
    let action = format!("publish {name}");
    let publisher = participant.create_publisher(&qos).map_err(|e| wrong(&action, &e))?;
    let writer = publisher.create_datawriter_no_key(&topic, Some(qos)).map_err(|e| wrong(&action, &e))?;
    Ok(DdsWriter { writer, topic: name.to_owned() })
}

fn wrong(action: &str, reason: &dyn std::fmt::Debug) -> CarrierError {
    CarrierError { action: action.to_owned(), reason: format!("{reason:?}") }
}

fn qos(quality: &Quality) -> QosPolicies {
    let reliability = match quality.is_reliable {
        true => Reliability::Reliable { max_blocking_time: MAX_BLOCKING },
        false => Reliability::BestEffort,
    };
    let durability = if quality.is_kept { Durability::TransientLocal } else { Durability::Volatile };
    QosPolicyBuilder::new()
        .reliability(reliability)
        .durability(durability)
        .history(History::KeepLast { depth: i32::from(quality.depth) })
        .build()
}

/// What a discovered reader or writer says; what it does not say is DDS's default.
fn quality_of(reliability: Option<Reliability>, durability: Option<Durability>, default: bool) -> Quality {
    let is_reliable = reliability.map_or(default, |r| matches!(r, Reliability::Reliable { .. }));
    let is_kept = durability.is_some_and(|d| d != Durability::Volatile);
    Quality { is_reliable, is_kept, depth: 1 }
}

impl Carrier for Dds {
    fn subscribe(
        &mut self,
        topic: &str,
        kind: RosType,
        quality: Quality,
    ) -> Result<Box<dyn Subscription>, CarrierError> {
        Ok(Box::new(self.reader(format!("{PREFIX}{topic}"), kind, quality)?))
    }

    fn publish(
        &mut self,
        topic: &str,
        kind: RosType,
        quality: Quality,
    ) -> Result<Box<dyn Publication>, CarrierError> {
        Ok(Box::new(self.writer(format!("{PREFIX}{topic}"), kind, quality)?))
    }

    fn serve(&mut self, name: &str, service: Service) -> Result<Box<dyn Server>, CarrierError> {
        let quality = Quality::DEFAULT;
        let requests = self.reader(format!("{REQUEST_PREFIX}{name}Request"), service.request, quality)?;
        let replies = self.writer(format!("{REPLY_PREFIX}{name}Reply"), service.response, quality)?;
        Ok(Box::new(DdsServer { requests, replies, service }))
    }

    fn wait(&mut self, timeout: std::time::Duration) -> bool {
        self.arrivals.wait(timeout)
    }

    fn has_ended(&mut self) -> bool {
        self.loops.have_ended()
    }

    fn introduce(&mut self) -> Result<(), CarrierError> {
        let guids = |ends: &[DdsEnd]| ends.iter().map(|end| end.guid).collect();
        self.node.tell(&NodeEnds {
            participant: self.participant.guid(),
            readers: guids(&self.readers),
            writers: guids(&self.writers),
        })
    }

    fn seen(&self) -> Vec<Seen> {
        let own = self.participant.guid_prefix();
        let seen: BTreeSet<Seen> = self
            .participant
            .discovered_writers()
            .into_iter()
            .map(|writer| writer.publication_topic_data)
            .filter(|data| data.key.prefix != own)
            .filter_map(|data| {
                let topic = data.topic_name.strip_prefix(PREFIX)?.to_owned();
                topic.starts_with('/').then(|| Seen { topic, kind: from_dds(&data.type_name) })
            })
            .collect();
        seen.into_iter().collect()
    }

    fn read_topics(&self) -> BTreeSet<String> {
        let own = self.participant.guid_prefix();
        let readers = self.participant.discovered_readers();
        let others = readers.iter().map(|r| &r.subscription_topic_data).filter(|d| d.key().prefix != own);
        others.filter_map(|data| data.topic_name().strip_prefix(PREFIX).map(str::to_owned)).collect()
    }

    fn unmatched(&self) -> Vec<String> {
        let own = self.participant.guid_prefix();
        let mut found = BTreeSet::new();
        for other in self.participant.discovered_writers() {
            let data = other.publication_topic_data;
            // A writer is reliable unless it says otherwise, a reader is not.
            let quality = quality_of(data.reliability, data.durability, true);
            for ours in self.readers.iter().filter(|ours| ours.topic == data.topic_name) {
                if data.key.prefix != own {
                    found.extend(refused(ours, &data.type_name, ours.quality.mismatch(&quality)));
                }
            }
        }
        for other in self.participant.discovered_readers() {
            let data = other.subscription_topic_data;
            let qos = data.qos();
            let quality = quality_of(qos.reliability(), qos.durability(), false);
            for ours in self.writers.iter().filter(|ours| ours.topic == data.topic_name) {
                if data.key().prefix != own {
                    found.extend(refused(ours, data.type_name(), quality.mismatch(&ours.quality)));
                }
            }
        }
        found.into_iter().collect()
    }

    fn alone(&self) -> Option<String> {
        let own = self.participant.guid_prefix();
        let writes = |other: &DiscoveredWriterData| other.publication_topic_data.key.prefix != own;
        let reads = |other: &DiscoveredReaderData| other.subscription_topic_data.key().prefix != own;
        if self.participant.discovered_writers().iter().any(writes)
            || self.participant.discovered_readers().iter().any(reads)
        {
            return None;
        }
        let (joined, foreign) = self
            .neighbours
            .as_ref()
            .map_or_else(Default::default, |neighbours| (neighbours.joined(), neighbours.foreign()));
        Some(alone_words(&self.network, &joined, &foreign))
    }

    fn words(&self) -> Vec<String> {
        let (domain, index) = (self.network.domain, self.participant.participant_id());
        let multicast = multicast_port(domain);
        let meta = self.neighbours.as_ref().map_or(unicast_port(domain, index), |n| n.port);
        let data = unicast_port(self.participant.domain_id(), index).saturating_add(1);
        let place = self.network.reach.words("this machine alone");
        let joined = format!(
            "DDS domain {domain}, discovery and data on {place} ({}); UDP ports {multicast} and {meta} for discovery, {data} for data",
            self.network.from
        );
        [joined].into_iter().chain(self.doubts.iter().cloned()).collect()
    }
}

/// What was tried where no other program is heard, and which line widens it.
fn alone_words(network: &Ros2Network, joined: &[Ipv4Addr], foreign: &[Ipv4Addr]) -> String {
    let list =
        |addresses: &[Ipv4Addr]| addresses.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
    let (domain, port) = (network.domain, multicast_port(network.domain));
    let place = network.reach.words(&format!("this machine, by multicast on {}", list(joined)));
    let mut words = format!(
        "no program is heard in DDS domain {domain} on {place}, UDP port {port}, and by the ports of participants on 127.0.0.1"
    );
    match (network.reach, foreign) {
        (NetworkReach::Loopback, []) => {
            words += "; a driver in a container or on another machine: --network all";
        }
        (NetworkReach::Loopback, foreign) => {
            words += &format!("; {} announces itself and is not answered: --network all", list(foreign));
        }
        _ => words += "; a firewall may keep UDP away",
    }
    words + "; one with another ROS_DOMAIN_ID: --domain N; one of rmw_zenoh: --carrier zenoh"
}

/// Why another's end and ours do not match, for people.
fn refused(ours: &DdsEnd, kind: &str, mismatch: Option<&'static str>) -> Option<String> {
    let topic = ours.topic.strip_prefix(PREFIX).unwrap_or(&ours.topic);
    if kind != ours.kind {
        let (found, expected) = (from_dds(kind), from_dds(&ours.kind));
        return Some(format!("{topic}: another program has type {found}, expected {expected}"));
    }
    mismatch.map(|why| format!("{topic}: {why}"))
}
