//! Names that are others in the network than in the program: several robots in one domain.

use crate::common::{Network, Setup, wait_for};
use crate::images::room;

#[test]
fn topics_and_services_have_the_names_that_they_are_given() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(100_000);
    room(setup.frames());
    let renamed = network.listen(&["map", "/tf:=/robot1/tf", "/tessera/map_cloud:=/robot1/cloud"]);
    let plain = network.listen(&[]);
    let names = [
        "/tf:=/robot1/tf",
        "/tessera/map_cloud:=/robot1/cloud",
        "/tessera/relocalise:=/tessera/save_map",
        "/tessera/save_map:=/other/save",
    ];
    let own: Vec<&str> = names.iter().flat_map(|name| ["--remap", name]).collect();
    let ros2 = network.join_and_run_with(&setup, &own);
    let _camera = network.camera(&setup, &[]);
    wait_for("transforms under their other name", || renamed.n_of("/robot1/tf") > 5);
    // It is made for those alone who read it.
    wait_for("the map under its other name", || renamed.n_of("/robot1/cloud") > 0);
    // Those of a name that was not changed are there too.
    wait_for("odometry", || plain.n_odometry() > 5);
    let reply = network.call("cyclone", "save_map");
    assert!(reply["message"].as_str().unwrap().ends_with("looks for its place anew"), "{reply}");
    ros2.terminate();
    ros2.finish();
    renamed.finish();
    assert!(plain.finish().iter().all(|line| line["topic"] != "/tf"));
}
