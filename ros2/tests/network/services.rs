//! Services that others call, and the name that they see.

use crate::common::{Network, Setup, room};
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
    let run = setup.run_arguments();
    let arguments: Vec<&str> = ["--run", "--"].into_iter().chain(run.iter().map(String::as_str)).collect();
    let ros2 = network.join(&setup, &arguments);
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
