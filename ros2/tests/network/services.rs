//! Services that others call.

use crate::common::{Network, Setup, room};
use serde_json::Value;

fn call(network: &Network, form: &str) -> Value {
    let line = network.call(form).pop().expect("a reply");
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
