//! The same over Zenoh as rmw_zenoh has it: the other side is eclipse-zenoh in Python, with a router of
//! its own for each test.

use crate::common::Setup;
use crate::images::room;
use crate::router::Router;
use serde_json::Value;
use std::path::PathBuf;

#[test]
fn frames_come_in_and_poses_go_out_as_others_read_them() {
    let Some(router) = Router::new() else { return };
    let Some(network) = router.network() else { return };
    let words = crate::exchange(&network);
    assert!(words.contains(&format!("router {} (ZENOH_CONFIG_OVERRIDE)", router.endpoint)), "{words}");
    assert!(words.contains("Zenoh domain") && words.contains("listens on 127.0.0.1 alone"), "{words}");
    assert!(!words.contains("no Zenoh router"), "{words}");
}

#[test]
fn the_camera_and_the_program_may_be_killed_and_the_run_goes_on() {
    let Some(router) = Router::new() else { return };
    let Some(network) = router.network() else { return };
    crate::kill(&network);
}

#[test]
fn a_router_may_come_late_and_go() {
    let Some(mut router) = Router::new() else { return };
    let Some(network) = router.network() else { return };
    router.kill();
    let setup = Setup::new(60);
    room(setup.frames());
    let run = setup.start();
    let ros2 = network.join(&setup, &[]);
    ros2.await_words(&format!("no Zenoh router at {}: others are not found", router.endpoint));
    router.start();
    let _camera = network.camera(&setup, &[]);
    setup.wait_for_growth("the first frames");
    // Those that know each other go on without it.
    router.kill();
    setup.wait_for_growth("frames without a router");
    setup.finish(run);
    ros2.finish();
}

#[test]
fn nonsense_is_told_and_counted_and_stops_nothing() {
    let Some(router) = Router::new() else { return };
    let Some(network) = router.network() else { return };
    let setup = Setup::new(120);
    room(setup.frames());
    let run = setup.start();
    let ros2 = network.join(&setup, &[]);
    let _camera = network.camera(&setup, &["--faults", "--rate", "20"]);
    setup.wait_for_growth("the first frames");
    std::fs::write(setup.frames().join("faults"), "").unwrap();
    setup.finish(run);
    let words = ros2.finish();
    for told in [
        "/camera/depth/image_rect_raw: no sensor_msgs/msg/Image",
        "cannot read /camera/depth/image_rect_raw: 8 bytes that begin with [110, 111, 110, 115], expected CDR",
        "/camera/depth/image_rect_raw: an attachment of 3 bytes, expected 33 as of rmw_zenoh; the message is taken",
        "80x120 px, expected 160x120",
    ] {
        assert!(words.contains(told), "no {told:?} in\n{words}");
    }
}

/// One that comes late has the map, and one of ROS 2 Humble finds the topics under its own names.
#[test]
fn late_readers_have_the_map_and_readers_of_humble_their_own_names() {
    let Some(router) = Router::new() else { return };
    let Some(network) = router.network() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let _run = setup.start();
    for distro in ["jazzy", "humble"] {
        let mut camera = Some(network.camera(&setup, &[]));
        let ros2 = network.join(&setup, &["--ros-distro", distro]);
        // The first one makes the program read the map, later ones get what it had sent: without a
        // camera the map does not change.
        for _ in 0..3 {
            let lines = network.listen(&["map", "once", distro]).await_end();
            for topic in ["/tessera/map_cloud", "/tessera/grid"] {
                let of: Vec<&Value> = lines.iter().filter(|line| line["topic"] == topic).collect();
                assert!(!of.is_empty() && of.iter().all(|line| line["same"] == true), "{topic}");
            }
            drop(camera.take());
        }
        ros2.terminate();
        ros2.finish();
    }
}

#[test]
fn the_graph_shows_the_node_while_it_lives() {
    let Some(router) = Router::new() else { return };
    let Some(network) = router.network() else { return };
    let setup = Setup::new(10);
    for (distro, namespace, node, hash) in [
        (
            "jazzy",
            "/tessera",
            "%/tessera",
            "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
        ),
        ("humble", "/robot/slam", "%robot/slam", "TypeHashNotSupported"),
    ] {
        let ros2 = network.join(&setup, &["--ros-distro", distro, "--namespace", namespace]);
        let told = network.ask("nodes_zenoh.py", &["there"]).pop().expect("tokens");
        let tokens: Vec<&str> = told.as_array().unwrap().iter().filter_map(Value::as_str).collect();
        let mangled = namespace.replace('/', "%");
        let odometry =
            format!("MP/%/{node}/{mangled}%odom/nav_msgs::msg::dds_::Odometry_/{hash}/::,10:,:,:,,");
        for expected in [
            format!("NN/%/{node}"),
            odometry,
            format!("SS/%/{node}/{mangled}%save_map/std_srvs::srv::dds_::Trigger_/"),
            format!("MS/%/{node}/%tf_static/tf2_msgs::msg::dds_::TFMessage_/"),
        ] {
            assert!(tokens.iter().any(|token| token.starts_with(&expected)), "no {expected} in {tokens:?}");
        }
        // Killed, it takes its tokens with it.
        drop(ros2);
        let told = network.ask("nodes_zenoh.py", &["gone"]).pop().expect("no tokens");
        assert_eq!(told.as_array().unwrap().len(), 0);
    }
}

#[test]
fn the_map_is_saved_for_clients_of_each_distribution_or_the_reason_is_told() {
    let Some(router) = Router::new() else { return };
    let Some(network) = router.network() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let _camera = network.camera(&setup, &[]);
    let _run = setup.start();
    let ros2 = network.join(&setup, &[]);
    setup.wait_for_growth("the first frames");
    let map = setup.out().join("map.ply");
    for form in ["jazzy", "humble"] {
        assert!(!map.exists());
        let saved = network.call(form, "save_map");
        assert_eq!(saved["success"], true, "{saved}");
        let folder = PathBuf::from(saved["message"].as_str().unwrap());
        assert_eq!(folder.canonicalize().unwrap(), setup.out().canonicalize().unwrap());
        std::fs::remove_file(&map).unwrap();
    }
    let refused = network.ask("call_zenoh.py", &["nonsense"]).pop().expect("a reply");
    assert_eq!(refused["error"], "2 bytes, expected CDR", "{refused}");
    ros2.terminate();
    let words = ros2.finish();
    assert!(words.contains("cannot read a request of /tessera/save_map: 2 bytes, expected CDR"), "{words}");
}

#[test]
fn a_reset_ends_the_run_and_begins_another() {
    let Some(router) = Router::new() else { return };
    let Some(network) = router.network() else { return };
    crate::services::reset(&network, "jazzy");
}
