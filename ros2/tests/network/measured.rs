//! What `scripts/measure_ros2.py` says of a real recording, image by image: as accurate as without a
//! network, and nothing lost.

use crate::common::{Network, root, tessera};
use crate::requirements::data;
use std::process::Command;

#[test]
fn a_recording_over_the_network_is_as_accurate_as_without_it() {
    let Some(network) = Network::new() else { return };
    let Some(sequence) = data("kitchen_450") else { return };
    let mut command = Command::new(network.python());
    command.arg(root().join("scripts/measure_ros2.py")).arg(sequence);
    command.args(["--in-step", "--frames", "60", "--runs", "1", "--domain", network.domain()]);
    command.arg("--tessera").arg(tessera().unwrap());
    command.args(["--program", env!("CARGO_BIN_EXE_tessera-ros2")]);
    let output = command.output().unwrap();
    let words = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{words}");
    let text = String::from_utf8_lossy(&output.stdout);
    let told: serde_json::Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    let (with, without) = (&told["medians"], &told["without"]);
    assert_eq!((with["frames"].as_f64(), with["odometry"].as_f64()), (Some(60.0), Some(60.0)), "{told}");
    let [with, without] = [with, without].map(|row| row["ate_map_m"].as_f64().unwrap());
    // Colour is decoded by another program here, and frames are counted from those before the recording.
    assert!((with - without).abs() <= 0.1 * without + 5e-4, "{told}");
    assert!((1e-4..0.05).contains(&with), "{told}");
}
