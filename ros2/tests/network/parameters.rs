//! Parameters of the node, asked for as `ros2 param` does, by Cyclone DDS and in the bytes of rosbags.

use crate::common::{Network, Setup, wait_for};

#[test]
fn parameters_are_listed_read_and_described_and_none_is_set() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(10);
    // Without a run and without a camera: the node is there.
    let ros2 = network.join(&setup, &["--map-spacing", "0.1", "--use-sim-time"]);
    for form in ["cyclone", "plain"] {
        let lines = network.ask("parameters.py", &[form]);
        let of = |name: &str| lines.iter().find(|line| line["name"] == name).expect("a parameter");
        assert_eq!((&of("map_spacing")["value"], &of("map_spacing")["type"]), (&0.1.into(), &3.into()));
        assert_eq!(of("use_sim_time")["value"], true);
        assert_eq!(of("base_frame")["value"], "base_link");
        assert_eq!(of("no_such")["type"], 0);
        let words = of("grid_cell")["words"].as_str().unwrap();
        assert!(words.contains("metres") && of("grid_cell")["read_only"] == true, "{lines:?}");
        let refused: Vec<_> = lines.iter().filter(|line| line["set"] == false).collect();
        assert_eq!(refused.len(), 3, "{lines:?}");
        let reason = |k: usize| refused[k]["reason"].as_str().unwrap();
        assert!(reason(0).contains("use_sim_time is read-only"), "{}", reason(0));
        assert!(reason(1).contains("no parameter \"no_such\""), "{}", reason(1));
        assert_eq!(reason(2), reason(0));
    }
    ros2.terminate();
    ros2.finish();
}

/// As rqt and nodes of rclcpp listen, from before the node on.
#[test]
fn parameters_are_told_once_on_parameter_events() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(10);
    let listener = network.ask_beside("parameter_events.py", &["plain"]);
    let ros2 = network.join(&setup, &["--map-spacing", "0.1", "--no-tf"]);
    wait_for("an event", || listener.0.n_of("new_parameters") > 0);
    ros2.terminate();
    ros2.finish();
    let lines = listener.finish();
    let [event] = &lines[..] else { panic!("{lines:?}") };
    assert_eq!((&event["node"], &event["same"]), (&"/tessera".into(), &true.into()), "{event}");
    assert!(event["sec"].as_i64().unwrap() > 1_700_000_000, "{event}");
    let declared = &event["new_parameters"];
    assert_eq!((&declared["map_spacing"], &declared["no_tf"]), (&0.1.into(), &true.into()), "{event}");
    for none in ["changed_parameters", "deleted_parameters"] {
        assert!(event[none].as_object().unwrap().is_empty(), "{event}");
    }
}
