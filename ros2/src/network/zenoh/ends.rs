//! Readers and writers of topics. What late readers are to have too is kept by the writer and asked for
//! by the reader, as rmw_zenoh does.

use super::arrivals::ZenohArrivals;
use super::attachment::Attachment;
use super::{lock, wrong};
use crate::carrier::{Bytes, CarrierError, ENCAPSULATION, Publication, Quality, Subscription};
use std::collections::{BTreeSet, VecDeque};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use zenoh::liveliness::LivelinessToken;
use zenoh::qos::CongestionControl;
use zenoh::sample::Sample;
use zenoh::{Session, Wait};
use zenoh_ext::{
    AdvancedPublisherBuilderExt, AdvancedSubscriberBuilderExt, CacheConfig, HistoryConfig,
    MissDetectionConfig, RecoveryConfig,
};

/// Time after which a writer that keeps messages says which was its last, as rmw_zenoh's.
const HEARTBEAT: Duration = Duration::from_millis(500);

/// What is odd and stops nothing, in words; told by the carrier.
pub(super) type Notes = Arc<Mutex<BTreeSet<String>>>;

/// The newest messages of a topic; older ones are left out.
type Queue = Arc<Mutex<VecDeque<Result<Bytes, String>>>>;

/// Reads a topic.
pub(super) struct ZenohReader {
    topic: String,
    queue: Queue,
    _held: HeldReader,
    _token: LivelinessToken,
}

#[expect(dead_code, reason = "they are held until the reader goes")]
enum HeldReader {
    Plain(zenoh::pubsub::Subscriber<()>),
    Kept(zenoh_ext::AdvancedSubscriber<()>),
}

impl ZenohReader {
    /// Reads from now on, and first what is kept where the quality says so.
    ///
    /// # Errors
    /// Where the session is closed.
    pub(super) fn open(
        session: &Session,
        (topic, key, token): (&str, String, LivelinessToken),
        quality: Quality,
        (notes, arrivals): (Notes, Arc<ZenohArrivals>),
    ) -> Result<Self, CarrierError> {
        let queue = Queue::default();
        let (to, name, depth) = (Arc::clone(&queue), topic.to_owned(), usize::from(quality.depth));
        let taken = move |sample: Sample| {
            take(&sample, &name, (&to, depth), &notes);
            arrivals.tell();
        };
        let builder = session.declare_subscriber(key).callback(taken);
        let held = if quality.is_kept {
            let history = HistoryConfig::default().detect_late_publishers().max_samples(depth);
            let builder = builder.history(history).subscriber_detection();
            builder.recovery(RecoveryConfig::default().heartbeat()).wait().map(HeldReader::Kept)
        } else {
            builder.wait().map(HeldReader::Plain)
        };
        let held = held.map_err(|error| wrong(&format!("subscribe {topic}"), &error))?;
        Ok(Self { topic: topic.to_owned(), queue, _held: held, _token: token })
    }
}

/// Puts a message into the queue. Runs in a thread of Zenoh, which nothing here may stop.
fn take(sample: &Sample, topic: &str, (queue, depth): (&Queue, usize), notes: &Notes) {
    let attachment = sample.attachment().map(zenoh::bytes::ZBytes::to_bytes);
    if let Err(words) = Attachment::read(attachment.as_deref()) {
        lock(notes).insert(format!("{topic}: {words}; the message is taken"));
    }
    let message = checked(sample.payload().to_bytes().into_owned());
    let mut queue = lock(queue);
    while queue.len() >= depth.max(1) {
        queue.pop_front();
    }
    queue.push_back(message);
}

/// A payload that has the encapsulation of plain CDR.
pub(super) fn checked(payload: Vec<u8>) -> Result<Bytes, String> {
    match payload.get(..ENCAPSULATION) {
        Some([0, 0 | 1, _, _]) => Ok(payload),
        Some(found) => Err(format!("{} bytes that begin with {found:?}, expected CDR", payload.len())),
        None => Err(format!("{} bytes, expected CDR", payload.len())),
    }
}

impl Subscription for ZenohReader {
    fn take(&mut self) -> Result<Option<Bytes>, CarrierError> {
        let message = lock(&self.queue).pop_front();
        message.transpose().map_err(|reason| wrong(&format!("read {}", self.topic), &reason))
    }
}

/// Writes a topic.
pub(super) struct ZenohWriter {
    topic: String,
    held: HeldWriter,
    number: i64,
    identity: [u8; 16],
    _token: LivelinessToken,
}

enum HeldWriter {
    Plain(zenoh::pubsub::Publisher<'static>),
    Kept(zenoh_ext::AdvancedPublisher<'static>),
}

impl ZenohWriter {
    /// Announces what is written.
    ///
    /// # Errors
    /// Where the session is closed.
    pub(super) fn open(
        session: &Session,
        (topic, key): (&str, String),
        quality: Quality,
        (token, identity): (LivelinessToken, [u8; 16]),
    ) -> Result<Self, CarrierError> {
        // As rmw_zenoh for all but "keep all": a reader that does not keep up stops nothing.
        let builder = session.declare_publisher(key).congestion_control(CongestionControl::Drop);
        let held = if quality.is_kept {
            let cache = CacheConfig::default().max_samples(usize::from(quality.depth));
            let misses = MissDetectionConfig::default().sporadic_heartbeat(HEARTBEAT);
            let builder = builder.cache(cache).publisher_detection().sample_miss_detection(misses);
            builder.wait().map(HeldWriter::Kept)
        } else {
            builder.wait().map(HeldWriter::Plain)
        };
        let held = held.map_err(|error| wrong(&format!("publish {topic}"), &error))?;
        Ok(Self { topic: topic.to_owned(), held, number: 0, identity, _token: token })
    }
}

impl Publication for ZenohWriter {
    fn send(&mut self, message: &[u8]) -> Result<(), CarrierError> {
        self.number = self.number.saturating_add(1);
        let attachment = Attachment { number: self.number, from: self.identity }.bytes();
        let sent = match &self.held {
            HeldWriter::Plain(publisher) => publisher.put(message).attachment(attachment).wait(),
            HeldWriter::Kept(publisher) => publisher.put(message).attachment(attachment).wait(),
        };
        sent.map_err(|error| wrong(&format!("write {}", self.topic), &error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_payload_without_encapsulation_has_its_words() {
        assert_eq!(checked(vec![0, 1, 0, 0, 5]), Ok(vec![0, 1, 0, 0, 5]));
        assert!(checked(vec![0, 0, 0, 0]).is_ok());
        assert_eq!(checked(vec![1, 2]).unwrap_err(), "2 bytes, expected CDR");
        let words = checked(b"nonsense".to_vec()).unwrap_err();
        assert_eq!(words, "8 bytes that begin with [110, 111, 110, 115], expected CDR");
    }
}
