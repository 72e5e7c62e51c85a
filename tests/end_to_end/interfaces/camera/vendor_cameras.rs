//! The adapters for OAK, Orbbec and Azure Kinect cameras, beside what their own SDKs compute without a camera.

use crate::common::python;
use std::path::Path;
use std::process::Command;

/// What the SDKs need of what they name: the Orbbec SDK's examples would bring 80 packages.
const PACKAGES: [&str; 5] = [
    "--no-deps",
    "iceoryx2==0.10.0",
    "flatbuffers==25.12.19",
    "opencv-python-headless==4.11.0.86",
    "numpy==1.26.4",
];

fn sends_what_the_sdk_projects(adapter: &str, sdk: &str) {
    let packages: Vec<&str> = PACKAGES.into_iter().chain([sdk]).collect();
    let Some(python) = python(adapter, &packages) else { return };
    let (root, place) = (Path::new(env!("CARGO_MANIFEST_DIR")), tempfile::tempdir().unwrap());
    let mut script = Command::new(python);
    script.arg(root.join("tests/end_to_end/interfaces/camera/vendor_cameras.py"));
    // The Orbbec SDK writes its log where it is started.
    script.arg(root.join("examples/python")).arg(adapter).current_dir(&place);
    let output = script.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn messages_of_depthai_are_sent_as_a_pinhole_sees_them() {
    sends_what_the_sdk_projects("oak", "depthai==3.12.0");
}

#[test]
fn frames_of_the_orbbec_sdk_are_sent_as_a_pinhole_sees_them() {
    sends_what_the_sdk_projects("orbbec", "pyorbbecsdk2==2.1.2");
}

#[test]
fn captures_of_the_azure_kinect_sdk_are_sent_as_a_pinhole_sees_them() {
    sends_what_the_sdk_projects("azure_kinect", "pyk4a-bundle==1.5.0");
}
