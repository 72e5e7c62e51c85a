//! A recording of Record3D that Apple's LZFSE library compressed, through the pipeline.

use crate::common::{python, room, write_folder};
use std::path::Path;
use std::process::Command;

const PACKAGES: [&str; 3] = ["pyliblzfse==0.4.1", "pillow", "numpy"];
const FRAMES: u64 = 12;

fn check(folder: &Path) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_tessera")).arg("check").arg(folder).output().unwrap();
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    (output.status.code(), text)
}

#[test]
fn a_recording_packed_or_not_is_the_folder_that_it_was_made_of() {
    let Some(python) = python("record3d", &PACKAGES) else { return };
    let run = room();
    let (frames, phone) = (run.dir.path().join("frames"), run.dir.path().join("phone"));
    let camera = run.dir.path().join("camera.toml");
    write_folder(&frames, &camera, FRAMES);
    let script =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/end_to_end/interfaces/files/write_record3d.py");
    let output = Command::new(python).arg(script).args([&frames, &phone]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));

    let (code, text) = check(&phone);
    assert_eq!(code, Some(0), "{text}");
    assert!(
        text.contains("Record3D (metadata, rgbd/)") && text.contains("12 of 12 depth and 12 colour images"),
        "{text}"
    );
    // Depth to the unit and the same camera: the poses are those of the folder.
    let of = |folder: &Path| {
        let run = room().of(folder).frames(FRAMES).with(&["--colour", "none"]);
        assert!(run.finish().success(), "{}", run.log());
        run.output("trajectory.txt")
    };
    let expected = of(&frames);
    assert!(of(&phone) == expected);
    let packed = run.dir.path().join("phone.r3d");
    let (code, text) = check(&packed);
    assert!(code == Some(0) && text.contains("12 of 12 depth and 12 colour images"), "{text}");
    assert!(of(&packed) == expected);

    let depth = phone.join("rgbd/5.depth");
    let bytes = std::fs::read(&depth).unwrap();
    std::fs::write(&depth, &bytes[..bytes.len() / 2]).unwrap();
    let (_, text) = check(&phone);
    assert!(text.contains("rgbd/5.depth") && text.contains("no end marker in"), "{text}");
}
