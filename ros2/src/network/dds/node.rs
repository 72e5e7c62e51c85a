//! The name under which `ros2 node list` shows this program: DDS knows participants and their ends alone,
//! and nodes of ROS say on `ros_discovery_info` which ends are theirs.

use super::raw::DdsWriter;
use crate::carrier::{CarrierError, NodeName, Publication};
use rustdds::GUID;
use serde::Serialize;
use tessera_recording::ros::encode;

pub(super) const TOPIC: &str = "ros_discovery_info";
pub(super) const KIND: &str = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// `rmw_dds_common/msg/Gid`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(untagged)]
enum Gid {
    Humble([u8; 24]),
    Later([u8; 16]),
}

/// `rmw_dds_common/msg/NodeEntitiesInfo`.
#[derive(Debug, Serialize)]
struct NodeEntitiesInfo<'a> {
    node_namespace: &'a str,
    node_name: &'a str,
    reader_gid_seq: Vec<Gid>,
    writer_gid_seq: Vec<Gid>,
}

/// `rmw_dds_common/msg/ParticipantEntitiesInfo`.
#[derive(Debug, Serialize)]
struct ParticipantEntitiesInfo<'a> {
    gid: Gid,
    node_entities_info_seq: Vec<NodeEntitiesInfo<'a>>,
}

/// Ends of this participant.
pub(super) struct NodeEnds {
    pub(super) participant: GUID,
    pub(super) readers: Vec<GUID>,
    pub(super) writers: Vec<GUID>,
}

/// Says what the node has.
pub(super) struct RosNode {
    pub(super) name: NodeName,
    pub(super) to: DdsWriter,
    pub(super) told: Vec<u8>,
}

impl RosNode {
    /// Tells it, where it has changed since.
    pub(super) fn tell(&mut self, ends: &NodeEnds) -> Result<(), CarrierError> {
        let message =
            message(&self.name, ends).map_err(|error| super::wrong("write a node's name", &error))?;
        if message != self.told {
            self.to.send(&message)?;
            self.told = message;
        }
        Ok(())
    }
}

fn message(name: &NodeName, ends: &NodeEnds) -> Result<Vec<u8>, tessera_recording::MessageError> {
    let (node_namespace, node_name) = name.split();
    let gid = |guid: &GUID| {
        let bytes = guid.to_bytes();
        if !name.is_humble {
            return Gid::Later(bytes);
        }
        let mut longer = [0; 24];
        longer[..16].copy_from_slice(&bytes);
        Gid::Humble(longer)
    };
    encode(&ParticipantEntitiesInfo {
        gid: gid(&ends.participant),
        node_entities_info_seq: vec![NodeEntitiesInfo {
            node_namespace,
            node_name,
            reader_gid_seq: ends.readers.iter().map(gid).collect(),
            writer_gid_seq: ends.writers.iter().map(gid).collect(),
        }],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn identities_are_longer_in_humble() {
        let guid = |first| GUID::from_bytes(std::array::from_fn(|k| first + k as u8));
        let ends = NodeEnds { participant: guid(0), readers: vec![guid(50)], writers: Vec::new() };
        let of =
            |is_humble| message(&NodeName { path: "/robot/tessera".to_owned(), is_humble }, &ends).unwrap();
        let (later, humble) = (of(false), of(true));
        assert_eq!(later[4..20], guid(0).to_bytes());
        assert_eq!((&humble[4..20], &humble[20..28]), (&guid(0).to_bytes()[..], &[0; 8][..]));
        assert_eq!(humble.len(), later.len() + 16);
        assert!(later.windows(15).any(|bytes| bytes == b"\x07\0\0\0/robot\0\0\x08\0\0"));
        let at_root = message(&NodeName { path: "/tessera".to_owned(), is_humble: false }, &ends).unwrap();
        assert!(at_root.windows(6).any(|bytes| bytes == b"\x02\0\0\0/\0"));
    }
}
