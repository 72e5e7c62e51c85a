//! Services that others call, and the name that they see.

use crate::common::{Network, Setup, room, wait_for};
use rustdds::bytes::Bytes;
use rustdds::policy::Reliability;
use rustdds::{
    DomainParticipantBuilder, QosPolicyBuilder, RTPSEntity, RepresentationIdentifier, SampleIdentity,
    SequenceNumber, TopicKind, WriteOptionsBuilder, no_key,
};
use serde_json::Value;

fn call(network: &Network, form: &str) -> Value {
    let line = network.ask("call.py", form).pop().expect("a reply");
    assert_eq!(line["same"], true, "{line}");
    line
}

#[test]
fn the_map_is_saved_while_the_run_goes_on_or_the_reason_is_told() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let _camera = network.camera(&setup, &[]);
    let ros2 = network.join_and_run(&setup);
    setup.wait_for_growth("the first frames");
    let (map, config) = (setup.out().join("map.ply"), setup.out().join("config.toml"));
    assert!(!map.exists());
    for form in ["cyclone", "plain"] {
        let saved = call(&network, form);
        assert_eq!(saved["success"], true, "{saved}");
        let folder = std::path::PathBuf::from(saved["message"].as_str().unwrap());
        assert_eq!(folder.canonicalize().unwrap(), setup.out().canonicalize().unwrap());
        assert!(map.metadata().unwrap().len() > 1000);
        std::fs::remove_file(&map).unwrap();
    }
    let aside = setup.frames().join("aside.toml");
    std::fs::rename(&config, &aside).unwrap();
    let refused = call(&network, "cyclone");
    assert_eq!(refused["success"], false, "{refused}");
    assert!(refused["message"].as_str().unwrap().contains("expected the folder of a run"), "{refused}");
    std::fs::rename(&aside, &config).unwrap();
    setup.wait_for_growth("frames after that");
    ros2.terminate();
    let words = ros2.finish();
    assert!(map.exists(), "{words}");
}

#[test]
fn the_node_has_a_name_and_its_own_topics() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(10);
    for (distro, namespace, expected) in
        [("jazzy", "/tessera", ["/", "tessera"]), ("humble", "/robot/slam", ["/robot", "slam"])]
    {
        let ros2 = network.join(&setup, &["--ros-distro", distro, "--namespace", namespace]);
        let node = network.ask("nodes.py", distro).pop().expect("a node");
        assert_eq!(node["same"], true, "{node}");
        assert_eq!([&node["namespace"], &node["name"]], expected);
        let has =
            |ends: &str, topic: String| node[ends].as_array().unwrap().iter().any(|name| *name == topic);
        assert!(
            has("writers", format!("rt{namespace}/odom")) && has("writers", "rt/tf".to_owned()),
            "{node}"
        );
        assert!(has("readers", "rt/tf_static".to_owned()), "{node}");
        assert!(has("readers", format!("rq{namespace}/save_mapRequest")), "{node}");
        ros2.terminate();
        ros2.finish();
    }
}

/// Passes the bytes of requests and replies, without their encapsulation.
struct Raw;

impl no_key::SerializerAdapter<Bytes> for Raw {
    type Error = std::io::Error;

    fn output_encoding() -> RepresentationIdentifier {
        RepresentationIdentifier::CDR_LE
    }

    fn to_bytes(value: &Bytes) -> Result<Bytes, Self::Error> {
        Ok(value.clone())
    }
}

#[derive(Clone)]
struct Decoder;

impl<'de> no_key::Decode<'de, Vec<u8>> for Decoder {
    type Error = std::io::Error;

    fn decode_bytes(self, body: &'de [u8], _: RepresentationIdentifier) -> Result<Vec<u8>, Self::Error> {
        Ok(body.to_vec())
    }
}

impl no_key::DeserializerAdapter<Vec<u8>> for Raw {
    type Error = std::io::Error;
    type Decoded = Vec<u8>;

    fn supported_encodings() -> &'static [RepresentationIdentifier] {
        &[RepresentationIdentifier::CDR_LE]
    }

    fn transform_decoded(decoded: Vec<u8>) -> Vec<u8> {
        decoded
    }
}

impl no_key::DefaultDecoder<Vec<u8>> for Raw {
    type Decoder = Decoder;
    const DECODER: Decoder = Decoder;
}

/// As rmw_fastrtps does it: the request names the end that waits for the reply, and the reply has the
/// identity of that end and the number of the request beside it.
#[test]
fn a_reply_has_the_identity_of_its_request_beside_it() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let _camera = network.camera(&setup, &[]);
    let _run = setup.start();
    let _ros2 = network.join(&setup, &[]);
    setup.wait_for_growth("the first frames");
    let builder = DomainParticipantBuilder::new(network.domain().parse().unwrap());
    let participant = builder.with_only_networks([std::net::Ipv4Addr::LOCALHOST]).build().unwrap();
    let reliability = Reliability::Reliable { max_blocking_time: rustdds::Duration::from_millis(100) };
    let qos = QosPolicyBuilder::new().reliability(reliability).build();
    let topic = |name: &str, kind: &str| {
        let kind = format!("std_srvs::srv::dds_::Trigger_{kind}_");
        participant.create_topic(name.to_owned(), kind, &qos, TopicKind::NoKey).unwrap()
    };
    let requests = topic("rq/tessera/save_mapRequest", "Request");
    let replies = topic("rr/tessera/save_mapReply", "Response");
    let writer: no_key::DataWriter<Bytes, Raw> =
        participant.create_publisher(&qos).unwrap().create_datawriter_no_key(&requests, None).unwrap();
    let mut reader: no_key::DataReader<Vec<u8>, Raw> =
        participant.create_subscriber(&qos).unwrap().create_datareader_no_key(&replies, None).unwrap();
    let waiting = SampleIdentity { writer_guid: reader.guid(), sequence_number: SequenceNumber::from(0) };
    let mut sent = Vec::new();
    let mut answered = None;
    wait_for("a reply", || {
        // What is sent before the server is discovered is lost.
        if sent.len() < 200 {
            let options = WriteOptionsBuilder::new().related_sample_identity(waiting).build();
            sent.push(writer.write_with_options(Bytes::from_static(&[0; 4]), options).unwrap());
        }
        std::thread::sleep(std::time::Duration::from_millis(500));
        answered = reader
            .take_next_sample()
            .unwrap()
            .map(|reply| (reply.sample_info().related_sample_identity().unwrap(), reply.into_value()));
        answered.is_some()
    });
    let (identity, content) = answered.unwrap();
    assert_eq!(identity.writer_guid, reader.guid());
    assert!(sent.iter().any(|request| request.sequence_number == identity.sequence_number));
    assert_eq!(content[0], 1, "{content:?}");
}
