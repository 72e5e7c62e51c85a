use super::*;
use clap::Parser;
use std::ffi::OsString;
use tessera_recording::ros::decode_whole;

fn arguments(words: &[&str]) -> Ros2Arguments {
    Ros2Arguments::try_parse_from(["tessera-ros2", "desk"].iter().chain(words)).unwrap()
}

fn asked(question: Question, request: &[u8]) -> Vec<u8> {
    let parameters = NodeParameter::all(&arguments(&["--map-spacing", "0.1"]));
    answer(&parameters, question, request).unwrap().expect("an answer")
}

#[test]
fn names_are_listed_all_or_by_prefix() {
    let list = |prefixes: &[&str]| {
        let message = asked(Question::List, &encode(&(prefixes, 0u64)).unwrap());
        decode_whole::<Listed>("names", &message).unwrap().names
    };
    let all = list(&[]);
    assert!(all.is_sorted() && all.contains(&"use_sim_time".to_owned()), "{all:?}");
    assert_eq!(list(&["map_spacing", "other"]), ["map_spacing"]);
}

#[test]
fn types_are_those_of_the_options_and_zero_for_other_names() {
    let request = encode(&["map_spacing", "nothing", "no_tf", "base_frame"].to_vec()).unwrap();
    let types = asked(Question::Types, &request);
    assert_eq!(types, [&[0, 1, 0, 0, 4, 0, 0, 0][..], &[3, 0, 1, 4]].concat());
    let values = asked(Question::Get, &request);
    let values: Vec<ParameterValue> = decode_whole("values", &values).unwrap();
    let expected = [ParameterValue::number(0.1), ParameterValue::default(), ParameterValue::flag(false)];
    assert_eq!(values[..3], expected);
    assert_eq!(values[3..], [ParameterValue::text("base_link".to_owned())]);
}

#[test]
fn each_parameter_is_described_by_the_help_of_its_option() {
    let parameters = NodeParameter::all(&arguments(&[]));
    for described in parameters.iter().map(NodeParameter::described) {
        assert!(described.read_only && described.description.len() > 8, "{described:?}");
    }
}

#[test]
fn what_is_no_request_is_told_from_what_is() {
    let value = ParameterValue::text("x".to_owned());
    let request = encode(&vec![("camera", &value), ("other", &ParameterValue::default())]).unwrap();
    assert!((SET.is_request)(&request) && !(GET.is_request)(&request));
    let result = asked(Question::Set, &request);
    let words = String::from_utf8_lossy(&result);
    assert!(words.contains("camera is read-only") && words.contains("no parameter \"other\""), "{words}");
    // Behind the numbers of rmw_cyclonedds' client nothing is a request by itself, and the other way round.
    let names = encode(&vec!["camera"]).unwrap();
    let headed = [&names[..4], &[7; 16], &names[4..]].concat();
    assert!((GET.is_request)(&names) && !(GET.is_request)(&headed) && !(LIST.is_request)(&names));
    for length in 0..request.len() - 8 {
        assert!(!(SET.is_request)(&request[..length]), "{length}");
    }
    let endless = [&[0, 1, 0, 0][..], &[255; 12]].concat();
    assert!([GET, LIST, SET].iter().all(|service| !(service.is_request)(&endless)));
}

/// `ros2 param dump` writes a file that a launch file gives back: the node is as it was.
#[test]
fn a_file_that_was_dumped_is_read_back() {
    let own = ["--map-spacing", "0.1", "--no-tf", "--grid-heights", "0.2,0.9", "--camera-info", "/a/info"];
    let parameters = NodeParameter::all(&arguments(&own));
    let line = |parameter: &NodeParameter| format!("    {}: {}\n", parameter.name, parameter.in_yaml());
    let lines: String = parameters.iter().map(line).collect();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("tessera.yaml");
    std::fs::write(&path, format!("/tessera:\n  ros__parameters:\n{lines}")).unwrap();
    let words = ["tessera-ros2", "desk", "--ros-args", "--params-file"].map(OsString::from);
    let words = crate::ros_arguments::as_own([&words[..], &[path.into()]].concat()).unwrap();
    assert_eq!(NodeParameter::all(&Ros2Arguments::try_parse_from(words).unwrap()), parameters);
}

#[test]
fn an_event_has_each_parameter_with_its_value() {
    let parameters = NodeParameter::all(&arguments(&["--no-tf"]));
    let message = events::declared("/robot1/tessera", &parameters, 1_500_000_000).unwrap();
    let event: events::ParameterEvent = decode_whole("an event", &message).unwrap();
    let expected = parameters.iter().map(|of| (of.name.clone(), of.value())).collect();
    let node = "/robot1/tessera".to_owned();
    assert_eq!(
        event,
        events::ParameterEvent {
            stamp: tessera_recording::ros::Time::from_nanos(1_500_000_000),
            node,
            new_parameters: expected,
            changed_parameters: Vec::new(),
            deleted_parameters: Vec::new(),
        }
    );
}
