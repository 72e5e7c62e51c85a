//! Names as rmw_zenoh has them: keys of topics and services, and tokens of liveliness, which say who
//! reads and writes what. As read in its `liveliness_utils.cpp`.

use super::wrong;
use crate::carrier::{CarrierError, NodeName, Quality, RosType};

/// Below this are all tokens.
pub(super) const TOKENS: &str = "@ros2_lv";
/// Stands for a slash, and for a name that is empty.
const SLASH: &str = "%";
/// The hash of all types in ROS 2 Humble.
const HUMBLE_HASH: &str = "TypeHashNotSupported";
/// What takes the place of a hash where every one will do.
pub(super) const ANY: &str = "*";

/// What an end is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum EndKind {
    Writer,
    Reader,
    Server,
    Client,
}

impl EndKind {
    const ALL: [(Self, &'static str); 4] =
        [(Self::Writer, "MP"), (Self::Reader, "MS"), (Self::Server, "SS"), (Self::Client, "SC")];

    fn code(self) -> &'static str {
        Self::ALL.iter().find(|(kind, _)| *kind == self).map_or("", |(_, code)| code)
    }
}

/// A reader or writer, or an end of a service, as its token says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ZenohEnd {
    pub(super) kind: EndKind,
    /// As `/camera/depth/image_raw`.
    pub(super) topic: String,
    /// As `sensor_msgs::msg::dds_::Image_`.
    pub(super) of: String,
    pub(super) hash: String,
    pub(super) quality: Quality,
}

/// The hash that the others have for a type.
pub(super) fn hash(kind: RosType, is_humble: bool) -> &'static str {
    if is_humble { HUMBLE_HASH } else { kind.hash }
}

/// The key of a topic's messages or of a service's requests.
///
/// # Errors
/// Where the name is none of ROS: in a key other signs have a meaning.
pub(super) fn key(domain: u16, topic: &str, kind: RosType, hash: &str) -> Result<String, CarrierError> {
    if !is_topic(topic) {
        let reason = "expected slashes, letters, digits and underscores, such as /camera/depth";
        return Err(wrong(&format!("use the topic {topic:?}"), &reason));
    }
    Ok(format!("{domain}{topic}/{}/{hash}", kind.in_dds()))
}

fn is_topic(name: &str) -> bool {
    name.strip_prefix('/').is_some_and(|rest| {
        let is_word =
            |word: &str| !word.is_empty() && word.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
        rest.split('/').all(is_word)
    })
}

/// Front part of the tokens of a node: session, and the node's number, which is always 0 here.
pub(super) struct Tokens<'a> {
    pub(super) domain: u16,
    pub(super) session: &'a str,
    pub(super) name: &'a NodeName,
}

impl Tokens<'_> {
    /// The token of the node itself.
    pub(super) fn node(&self) -> String {
        self.token("0", "NN")
    }

    /// The token of one of its ends, by the end's number.
    pub(super) fn end(&self, number: u32, end: &ZenohEnd) -> String {
        let front = self.token(&number.to_string(), end.kind.code());
        let (topic, of, hash) = (mangled(&end.topic), &end.of, &end.hash);
        format!("{front}/{topic}/{of}/{hash}/{}", quality_words(&end.quality))
    }

    fn token(&self, number: &str, code: &str) -> String {
        let (namespace, name) = self.name.split();
        let namespace = mangled(namespace);
        let (domain, session) = (self.domain, self.session);
        format!("{TOKENS}/{domain}/{session}/0/{number}/{code}/{SLASH}/{namespace}/{name}")
    }
}

fn mangled(name: &str) -> String {
    name.replace('/', SLASH)
}

/// Quality of service: reliability, durability, history and depth; the rest as by default. What is as by
/// default is left out; the default of the depth is none that is used here.
fn quality_words(quality: &Quality) -> String {
    let reliability = if quality.is_reliable { "" } else { "2" };
    let durability = if quality.is_kept { "1" } else { "" };
    format!("{reliability}:{durability}:,{}:,:,:,,", quality.depth)
}

/// The session and the end of a token; `None` where it is that of a node, or none that is known.
pub(super) fn parse(token: &str) -> Option<(&str, ZenohEnd)> {
    let words: Vec<&str> = token.split('/').collect();
    let [TOKENS, _, session, _, _, code, _, _, _, topic, of, hash, quality] = words[..] else { return None };
    let (kind, _) = EndKind::ALL.into_iter().find(|(_, known)| *known == code)?;
    let topic = topic.replace(SLASH, "/");
    let mut parts = quality.split(':');
    let (reliability, durability) = (parts.next()?, parts.next()?);
    let quality = Quality { is_reliable: reliability != "2", is_kept: durability == "1", depth: 1 };
    let (of, hash) = (of.to_owned(), hash.to_owned());
    is_topic(&topic).then_some((session, ZenohEnd { kind, topic, of, hash, quality }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::carrier::{IMAGE, TRIGGER};

    fn tokens<'a>(name: &'a NodeName) -> Tokens<'a> {
        Tokens { domain: 7, session: "ab12", name }
    }

    #[test]
    fn keys_are_those_of_rmw_zenoh() {
        let found = key(0, "/camera/x", IMAGE, hash(IMAGE, false)).unwrap();
        let end = "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47";
        assert_eq!(found, format!("0/camera/x/sensor_msgs::msg::dds_::Image_/{end}"));
        let found = key(7, "/tessera/save_map", TRIGGER.kind, hash(TRIGGER.kind, true)).unwrap();
        assert_eq!(found, "7/tessera/save_map/std_srvs::srv::dds_::Trigger_/TypeHashNotSupported");
        for wrong in ["camera", "/a//b", "/a/*", "/a/$*", "/", "/a?"] {
            assert!(key(0, wrong, IMAGE, ANY).is_err(), "{wrong}");
        }
    }

    #[test]
    fn tokens_are_those_of_rmw_zenoh_and_are_read_again() {
        let name = NodeName { path: "/tessera".to_owned(), is_humble: false };
        assert_eq!(tokens(&name).node(), "@ros2_lv/7/ab12/0/0/NN/%/%/tessera");
        let name = NodeName { path: "/robot/one/slam".to_owned(), is_humble: false };
        assert_eq!(tokens(&name).node(), "@ros2_lv/7/ab12/0/0/NN/%/%robot%one/slam");
        let of = || "sensor_msgs::msg::dds_::Image_".to_owned();
        for (kind, quality, code, words) in [
            (EndKind::Reader, Quality::SENSOR, "MS", "2::,5:,:,:,,"),
            (EndKind::Writer, Quality::LATCHED, "MP", ":1:,1:,:,:,,"),
            (EndKind::Server, Quality::DEFAULT, "SS", "::,10:,:,:,,"),
        ] {
            let (topic, hash) = ("/a/depth".to_owned(), "RIHS01_00".to_owned());
            let end = ZenohEnd { kind, topic, of: of(), hash, quality };
            let token = tokens(&name).end(3, &end);
            let front = format!("@ros2_lv/7/ab12/0/3/{code}/%/%robot%one/slam/%a%depth");
            assert_eq!(token, format!("{front}/sensor_msgs::msg::dds_::Image_/RIHS01_00/{words}"));
            let (session, read) = parse(&token).unwrap();
            assert_eq!((session, read.quality.is_kept), ("ab12", end.quality.is_kept));
            assert_eq!(ZenohEnd { quality: end.quality, ..read }, end);
        }
    }

    #[test]
    fn what_is_no_token_of_an_end_is_left_out() {
        for wrong in [
            "@ros2_lv/7/ab12/0/0/NN/%/%/tessera",
            "@ros2_lv/7/ab12/0/0/XX/%/%/n/%a/T/h/::,1",
            "@ros2_lv/7/ab12/0/0/MP/%/%/n/%a%%b/T/h/::,1",
            "@ros2_lv/7/ab12/0/0/MP/%/%/n/%a/T/h/x",
            "other/7/ab12/0/0/MP/%/%/n/%a/T/h/::,1",
            "",
        ] {
            assert_eq!(parse(wrong), None, "{wrong}");
        }
    }
}
