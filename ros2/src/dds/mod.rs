//! DDS, by RustDDS: messages pass as bytes, and what they mean is not its business.

mod raw;
mod service;

use crate::carrier::{
    Carrier, CarrierError, Publication, Quality, RosType, Seen, Server, Service, Subscription, from_dds,
};
use crate::network::{Network, Reach};
use raw::{Reader, Writer};
use rustdds::policy::{Durability, History, Reliability};
use rustdds::{
    DomainParticipant, DomainParticipantBuilder, Duration, QosPolicies, QosPolicyBuilder, RTPSEntity,
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
    network: Network,
    readers: Vec<End>,
    writers: Vec<End>,
}

/// A reader or writer: topic and type as DDS has them.
#[derive(Clone, Debug)]
struct End {
    topic: String,
    kind: String,
    quality: Quality,
}

impl Dds {
    /// Joins a domain.
    ///
    /// # Errors
    /// Where the sockets cannot be had.
    pub(crate) fn open(network: &Network) -> Result<Self, CarrierError> {
        let builder = DomainParticipantBuilder::new(network.domain);
        let builder = match network.reach {
            Reach::Loopback => builder.with_only_networks([Ipv4Addr::LOCALHOST]),
            Reach::Interface(address) => {
                builder.with_only_networks([address, IpAddr::V4(Ipv4Addr::LOCALHOST)])
            }
            Reach::All => builder,
        };
        let participant =
            builder.build().map_err(|error| wrong(&format!("join DDS domain {}", network.domain), &error))?;
        Ok(Self { participant, network: network.clone(), readers: Vec::new(), writers: Vec::new() })
    }

    fn reader(&mut self, end: End) -> Result<Reader, CarrierError> {
        let (topic, qos) = self.topic(&end)?;
        let action = format!("subscribe {}", end.topic);
        let subscriber = self.participant.create_subscriber(&qos).map_err(|e| wrong(&action, &e))?;
        let reader =
            subscriber.create_datareader_no_key(&topic, Some(qos)).map_err(|e| wrong(&action, &e))?;
        let name = end.topic.clone();
        self.readers.push(end);
        Ok(Reader { reader, topic: name })
    }

    fn writer(&mut self, end: End) -> Result<Writer, CarrierError> {
        let (topic, qos) = self.topic(&end)?;
        let action = format!("publish {}", end.topic);
        let publisher = self.participant.create_publisher(&qos).map_err(|e| wrong(&action, &e))?;
        let writer = publisher.create_datawriter_no_key(&topic, Some(qos)).map_err(|e| wrong(&action, &e))?;
        let name = end.topic.clone();
        self.writers.push(end);
        Ok(Writer { writer, topic: name })
    }

    fn topic(&self, end: &End) -> Result<(rustdds::Topic, QosPolicies), CarrierError> {
        let qos = qos(&end.quality);
        let made = self.participant.create_topic(end.topic.clone(), end.kind.clone(), &qos, TopicKind::NoKey);
        Ok((made.map_err(|error| wrong(&format!("make topic {}", end.topic), &error))?, qos))
    }
}

fn wrong(action: &str, reason: &dyn std::fmt::Debug) -> CarrierError {
    CarrierError { action: action.to_owned(), reason: format!("{reason:?}") }
}

fn end(topic: &str, kind: RosType, quality: Quality) -> End {
    End { topic: format!("{PREFIX}{topic}"), kind: kind.in_dds(), quality }
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
        Ok(Box::new(self.reader(end(topic, kind, quality))?))
    }

    fn publish(
        &mut self,
        topic: &str,
        kind: RosType,
        quality: Quality,
    ) -> Result<Box<dyn Publication>, CarrierError> {
        Ok(Box::new(self.writer(end(topic, kind, quality))?))
    }

    fn serve(&mut self, name: &str, service: Service) -> Result<Box<dyn Server>, CarrierError> {
        let quality = Quality::DEFAULT;
        let end = |topic: String, kind: RosType| End { topic, kind: kind.in_dds(), quality };
        let requests = self.reader(end(format!("{REQUEST_PREFIX}{name}Request"), service.request))?;
        let replies = self.writer(end(format!("{REPLY_PREFIX}{name}Reply"), service.response))?;
        Ok(Box::new(DdsServer { requests, replies }))
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

    fn words(&self) -> String {
        let (domain, index) = (self.network.domain, self.participant.participant_id());
        let (multicast, own) = (7400 + 250 * u32::from(domain), u32::from(index));
        let place = match self.network.reach {
            Reach::Loopback => "127.0.0.1 alone".to_owned(),
            Reach::Interface(address) => format!("{address} and 127.0.0.1"),
            Reach::All => "all interfaces".to_owned(),
        };
        format!(
            "DDS domain {domain}, discovery and data on {place} ({}); UDP ports {multicast}, {}, {}, {}",
            self.network.from,
            multicast + 1,
            multicast + 10 + 2 * own,
            multicast + 11 + 2 * own
        )
    }
}

/// Why another's end and ours do not match, for people.
fn refused(ours: &End, kind: &str, mismatch: Option<&'static str>) -> Option<String> {
    let topic = ours.topic.strip_prefix(PREFIX).unwrap_or(&ours.topic);
    if kind != ours.kind {
        let (found, expected) = (from_dds(kind), from_dds(&ours.kind));
        return Some(format!("{topic}: another program has type {found}, expected {expected}"));
    }
    mismatch.map(|why| format!("{topic}: {why}"))
}
