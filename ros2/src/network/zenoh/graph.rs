//! Who reads and writes what, as the tokens of others say.

use super::keys::{EndKind, TOKENS, ZenohEnd, parse};
use super::{lock, wrong};
use crate::carrier::{CarrierError, Seen, from_dds};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};
use zenoh::sample::SampleKind;
use zenoh::{Session, Wait};

/// Ends of others, by their tokens.
type GraphEnds = BTreeMap<String, ZenohEnd>;

/// Follows the tokens of a domain.
pub(super) struct RosGraph {
    ends: Arc<Mutex<GraphEnds>>,
    _tokens: zenoh::pubsub::Subscriber<()>,
}

impl RosGraph {
    /// Looks at what is there, and at what comes and goes from now on.
    ///
    /// # Errors
    /// Where the session is closed.
    pub(super) fn open(session: &Session, domain: u16) -> Result<Self, CarrierError> {
        let ends = Arc::<Mutex<GraphEnds>>::default();
        let (known, own) = (Arc::clone(&ends), session.zid().to_string());
        let tokens = session
            .liveliness()
            .declare_subscriber(format!("{TOKENS}/{domain}/**"))
            .history(true)
            .callback(move |sample| {
                let is_there = sample.kind() == SampleKind::Put;
                note(&mut lock(&known), sample.key_expr().as_str(), &own, is_there);
            })
            .wait()
            .map_err(|error| wrong("look for topics", &error))?;
        Ok(Self { ends, _tokens: tokens })
    }

    /// The topics that others write.
    pub(super) fn seen(&self) -> Vec<Seen> {
        let ends = lock(&self.ends);
        let writers = ends.values().filter(|end| end.kind == EndKind::Writer);
        let seen: BTreeSet<Seen> =
            writers.map(|end| Seen { topic: end.topic.clone(), kind: from_dds(&end.of) }).collect();
        seen.into_iter().collect()
    }

    /// The topics that others read.
    pub(super) fn read_topics(&self) -> BTreeSet<String> {
        let ends = lock(&self.ends);
        let readers = ends.values().filter(|end| end.kind == EndKind::Reader);
        readers.map(|end| end.topic.clone()).collect()
    }

    /// Why ends of others cannot be joined to ours.
    pub(super) fn unmatched(&self, ours: &[ZenohEnd]) -> BTreeSet<String> {
        let ends = lock(&self.ends);
        ends.values().flat_map(|other| ours.iter().filter_map(|ours| refused(ours, other))).collect()
    }
}

/// Takes down that a token came or went.
fn note(ends: &mut GraphEnds, token: &str, own: &str, is_there: bool) {
    if !is_there {
        ends.remove(token);
    } else if let Some((session, end)) = parse(token)
        && session != own
    {
        ends.insert(token.to_owned(), end);
    }
}

/// Why another's end and ours do not match; `None` where they do, or have nothing to do with each other.
fn refused(ours: &ZenohEnd, other: &ZenohEnd) -> Option<String> {
    let is_pair = matches!(
        (ours.kind, other.kind),
        (EndKind::Writer, EndKind::Reader)
            | (EndKind::Reader, EndKind::Writer)
            | (EndKind::Server, EndKind::Client)
    );
    if !is_pair || ours.topic != other.topic {
        return None;
    }
    let topic = &ours.topic;
    if ours.of != other.of {
        let (found, expected) = (from_dds(&other.of), from_dds(&ours.of));
        return Some(format!("{topic}: another program has type {found}, expected {expected}"));
    }
    // What is read is read with every hash, and so are requests.
    if ours.kind == EndKind::Writer && ours.hash != other.hash {
        let (found, expected) = (&other.hash, &ours.hash);
        return Some(format!(
            "{topic}: a reader has the type hash {found}, expected {expected}: is --ros-distro right?"
        ));
    }
    let reader_wants_more = match ours.kind {
        EndKind::Writer => other.quality.is_kept && !ours.quality.is_kept,
        _ => ours.quality.is_kept && !other.quality.is_kept,
    };
    (reader_wants_more && ours.kind != EndKind::Server).then(|| {
        format!("{topic}: the writer is volatile, the reader wants transient local: it gets what comes from now on")
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::carrier::Quality;

    fn end(kind: EndKind, of: &str, hash: &str, quality: Quality) -> ZenohEnd {
        ZenohEnd { kind, topic: "/a".to_owned(), of: of.to_owned(), hash: hash.to_owned(), quality }
    }

    #[test]
    fn tokens_come_and_go_and_ours_are_none_of_others() {
        let token = |session: &str| format!("@ros2_lv/7/{session}/0/1/MP/%/%/n/%a/p::msg::dds_::T_/h/::,1");
        let mut ends = GraphEnds::new();
        for session in ["one", "two", "own", "two"] {
            note(&mut ends, &token(session), "own", true);
        }
        assert_eq!(ends.len(), 2);
        note(&mut ends, &token("two"), "own", false);
        assert_eq!(ends.into_keys().collect::<Vec<_>>(), [token("one")]);
    }

    #[test]
    fn what_does_not_match_is_told() {
        let ours = end(EndKind::Writer, "p::msg::dds_::T_", "h", Quality::DEFAULT);
        let told = |other: ZenohEnd| refused(&ours, &other);
        let same = |kind, quality| end(kind, "p::msg::dds_::T_", "h", quality);
        assert_eq!(told(same(EndKind::Reader, Quality::SENSOR)), None);
        assert_eq!(told(end(EndKind::Writer, "x", "y", Quality::DEFAULT)), None);
        assert!(told(same(EndKind::Reader, Quality::LATCHED)).unwrap().contains("volatile"));
        let other = end(EndKind::Reader, "p::msg::dds_::U_", "h", Quality::DEFAULT);
        assert_eq!(told(other).unwrap(), "/a: another program has type p/msg/U, expected p/msg/T");
        let other = end(EndKind::Reader, "p::msg::dds_::T_", "TypeHashNotSupported", Quality::DEFAULT);
        assert!(told(other).unwrap().contains("type hash TypeHashNotSupported, expected h"));
        let reader = ZenohEnd { kind: EndKind::Reader, ..ours.clone() };
        assert_eq!(refused(&reader, &end(EndKind::Writer, &ours.of, "other", Quality::SENSOR)), None);
    }
}
