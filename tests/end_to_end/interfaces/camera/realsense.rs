//! The adapter for RealSense cameras, fed by the software device of their own SDK.

use crate::common::{python, room, write_folder};
use std::path::Path;
use std::process::{Command, Stdio};

const PACKAGES: [&str; 5] =
    ["iceoryx2==0.10.0", "pyrealsense2==2.59.1.11053", "libusb-package==1.0.30.0", "numpy", "pillow"];
const FRAMES: u64 = 40;
#[test]
fn a_software_device_of_the_sdk_is_a_camera() {
    let Some(python) = python("realsense", &PACKAGES) else { return };
    let external = room().of(Path::new("external")).frames(FRAMES);
    let (folder, camera) = (external.dir.path().join("frames"), external.dir.path().join("camera.toml"));
    write_folder(&folder, &camera, FRAMES);
    let reference = room().of(&folder).frames(FRAMES);
    assert!(reference.finish().success());
    std::fs::copy(&camera, folder.join("camera.toml")).unwrap();

    let run = external.start();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let script = root.join("tests/end_to_end/interfaces/camera/software_realsense.py");
    let mut device = Command::new(python);
    device.arg(script).arg(root.join("examples/python")).arg(&folder).arg(&external.name);
    let device = device.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let status = run.wait_with_output().unwrap().status;
    let words = device.wait_with_output().unwrap();
    let words = String::from_utf8_lossy(&words.stderr).into_owned();
    assert!(status.success(), "{words}\n{}", external.log());

    // A live run leaves frames out where the machine is busy; what it has lies where the folder's lie.
    let paths = [external.out(), reference.out()].map(|out| out.join("trajectory.txt"));
    let mut evaluate = Command::new(env!("CARGO_BIN_EXE_tessera"));
    let output = evaluate.arg("evaluate").args(&paths).arg("--json").output().unwrap();
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("an evaluation");
    assert!(found["pairs"].as_u64().unwrap() >= 5, "{found} {words}\n{}", external.log());
    assert!(found["ate_rmse_m"].as_f64().unwrap() < 0.02, "{found}");
}
