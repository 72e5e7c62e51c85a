//! Services that others call, and the name that they see.

use crate::common::{Network, Setup, root, wait_for, wait_for_growth};
use crate::images::room;
use rustdds::bytes::Bytes;
use rustdds::policy::Reliability;
use rustdds::{
    DomainParticipantBuilder, QosPolicyBuilder, RTPSEntity, RepresentationIdentifier, SampleIdentity,
    SequenceNumber, TopicKind, WriteOptionsBuilder, no_key,
};
use std::path::PathBuf;

#[test]
fn the_map_is_saved_while_the_run_goes_on_or_the_reason_is_told() {
    let Some(network) = Network::new() else { return };
    let (setup, _camera, ros2) = network.running();
    let (map, config) = (setup.out().join("map.ply"), setup.out().join("config.toml"));
    assert!(!map.exists());
    for form in ["cyclone", "plain"] {
        let saved = network.call(form, "save_map");
        assert_eq!(saved["success"], true, "{saved}");
        let folder = PathBuf::from(saved["message"].as_str().unwrap());
        assert_eq!(folder.canonicalize().unwrap(), setup.out().canonicalize().unwrap());
        assert!(map.metadata().unwrap().len() > 1000);
        let (grid, image) = (setup.out().join("map.yaml"), setup.out().join("map.pgm"));
        assert!(std::fs::read_to_string(&grid).unwrap().starts_with("image: map.pgm\n"));
        assert!(std::fs::read(&image).unwrap().starts_with(b"P5\n"));
        [grid, image].iter().for_each(|file| std::fs::remove_file(file).unwrap());
        std::fs::remove_file(&map).unwrap();
    }
    let aside = setup.frames().join("aside.toml");
    std::fs::rename(&config, &aside).unwrap();
    let refused = network.call("cyclone", "save_map");
    assert_eq!(refused["success"], false, "{refused}");
    assert!(refused["message"].as_str().unwrap().contains("expected the folder of a run"), "{refused}");
    std::fs::rename(&aside, &config).unwrap();
    setup.wait_for_growth("frames after that");
    ros2.terminate();
    let words = ros2.finish();
    assert!(map.exists(), "{words}");
}

#[test]
fn a_reset_ends_the_run_and_begins_another() {
    let Some(network) = Network::new() else { return };
    reset(&network, "cyclone");
}

/// What the summary of a run says of its end.
pub(crate) fn ended(out: &std::path::Path) -> String {
    let summary = std::fs::read_to_string(out.join("summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
    format!("{} {} of {} frames", summary["ended"], summary["frames_processed"], summary["frames_read"])
}

/// Two resets of a run that goes on: each ends a run with its outputs and begins one of its own name,
/// whose odometry begins anew.
pub(crate) fn reset(network: &Network, form: &str) {
    let setup = Setup::new(100_000);
    room(setup.frames());
    let listener = network.listen(&[]);
    let _camera = network.camera(&setup, &[]);
    let ros2 = network.join_and_run(&setup);
    setup.wait_for_growth("the first frames");
    let outs = ["out", "out-2", "out-3"].map(|name| setup.frames().join(name));
    let names = [setup.name.clone(), format!("{}-2", setup.name), format!("{}-3", setup.name)];
    for k in 1..3 {
        let reply = network.call(form, "reset");
        let words = reply["message"].as_str().unwrap();
        assert_eq!(reply["success"], true, "{reply}");
        assert!(
            words.contains(&format!("the run {} has begun; {} is in", names[k], names[k - 1])),
            "{reply}"
        );
        assert!(outs[k - 1].join("map.ply").metadata().unwrap().len() > 1000, "{reply}");
        assert!(ended(&outs[k - 1]).starts_with("\"finished\""), "{} {reply}", ended(&outs[k - 1]));
        wait_for_growth(&outs[k], "frames of the next run");
    }
    ros2.terminate();
    let words = ros2.finish();
    assert!(ended(&outs[2]).starts_with("\"finished\""), "{} {words}", ended(&outs[2]));
    let lines = listener.finish();
    let told = |name: &String| {
        let name = format!("tessera: {name}");
        lines.iter().any(|line| line["topic"] == "/diagnostics" && line["status"][0]["name"] == name)
    };
    assert!(names.iter().all(told), "{words}");
    // What is published is the run's own pose each time, whose odom begins anew.
    for out in &outs {
        let rows = crate::online(out);
        let n = lines.iter().filter(|line| line["topic"] == "/tf" && crate::is_of_run(line, &rows)).count();
        assert!(n >= 3, "{n} of {} in {}", rows.len(), out.display());
    }
}

/// Rows of `states.csv` that say that relocalisation was asked for.
fn asked(out: &std::path::Path) -> Vec<String> {
    let states = std::fs::read_to_string(out.join("states.csv")).unwrap();
    let is_asked = |line: &&str| line.contains("a relocalisation was asked for");
    states.lines().filter(is_asked).map(str::to_owned).collect()
}

#[test]
fn relocalisation_is_asked_for_with_an_image_or_refused() {
    let Some(network) = Network::new() else { return };
    let (setup, camera, ros2) = network.running();
    for form in ["cyclone", "plain"] {
        let reply = network.call(form, "relocalise");
        assert_eq!(reply["success"], true, "{reply}");
        assert_eq!(reply["message"], format!("the run {} looks for its place anew", setup.name));
        setup.wait_for_growth("frames after that");
    }
    drop(camera);
    let refused = network.call("cyclone", "relocalise");
    assert_eq!(refused["success"], false, "{refused}");
    assert!(refused["message"].as_str().unwrap().starts_with("no image went into the run"), "{refused}");
    ros2.terminate();
    let words = ros2.finish();
    assert_eq!(asked(&setup.out()).len(), 2, "{:?} {words}", asked(&setup.out()));
}

#[test]
fn a_run_that_was_started_elsewhere_is_not_reset() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let _camera = network.camera(&setup, &[]);
    let _run = setup.start();
    let ros2 = network.join(&setup, &[]);
    setup.wait_for_growth("the first frames");
    let refused = network.call("cyclone", "reset");
    assert_eq!(refused["success"], false, "{refused}");
    let expected = format!("this program did not start the run {}", setup.name);
    assert!(refused["message"].as_str().unwrap().starts_with(&expected), "{refused}");
    setup.wait_for_growth("frames after that");
    ros2.terminate();
    ros2.finish();
}

/// Topics that the layouts for RViz and Foxglove show.
fn topics_of_layouts() -> Vec<String> {
    let layouts = root().join("ros2/layouts");
    let rviz = std::fs::read_to_string(layouts.join("tessera.rviz")).unwrap();
    let mut topics: Vec<String> = rviz
        .lines()
        .filter_map(|line| line.trim().strip_prefix("Value: /"))
        .map(|name| format!("/{name}"))
        .collect();
    let foxglove = std::fs::read_to_string(layouts.join("foxglove.json")).unwrap();
    let panels: serde_json::Value = serde_json::from_str(&foxglove).unwrap();
    let panels = &panels["configById"];
    topics.extend(panels["3D!tessera"]["topics"].as_object().unwrap().keys().cloned());
    topics.push(panels["DiagnosticSummary!tessera"]["topicToRender"].as_str().unwrap().to_owned());
    for path in panels["Plot!tessera"]["paths"].as_array().unwrap() {
        topics.push(path["value"].as_str().unwrap().split('.').next().unwrap().to_owned());
    }
    assert!(topics.len() >= 12, "{topics:?}");
    topics
}

#[test]
fn the_node_has_a_name_and_its_own_topics() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(10);
    for (distro, namespace, expected) in
        [("jazzy", "/tessera", ["/", "tessera"]), ("humble", "/robot/slam", ["/robot", "slam"])]
    {
        let ros2 = network.join(&setup, &["--ros-distro", distro, "--namespace", namespace]);
        let node = network.ask("nodes.py", &[distro]).pop().expect("a node");
        assert_eq!(node["same"], true, "{node}");
        assert_eq!([&node["namespace"], &node["name"]], expected);
        let has =
            |ends: &str, topic: String| node[ends].as_array().unwrap().iter().any(|name| *name == topic);
        assert!(
            has("writers", format!("rt{namespace}/odom")) && has("writers", "rt/tf".to_owned()),
            "{node}"
        );
        assert!(has("readers", "rt/tf_static".to_owned()), "{node}");
        for topic in topics_of_layouts().iter().filter(|_| namespace == "/tessera") {
            assert!(has("writers", format!("rt{topic}")), "{topic} of ros2/layouts is not in {node}");
        }
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
