//! The example that makes objects of other programs from a map and a mesh.

use crate::common::python;
use std::path::Path;
use std::process::Command;

const PACKAGES: [&str; 2] = ["trimesh==5.2.0", "numpy"];

#[test]
fn a_mesh_is_an_object_of_trimesh_with_its_colours() {
    let Some(python) = python("objects", &PACKAGES) else { return };
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let script = root.join("tests/end_to_end/interfaces/files/use_objects.py");
    let output = Command::new(python).arg(script).arg(root.join("examples/python")).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(String::from_utf8_lossy(&output.stdout).contains("trimesh"));
}
