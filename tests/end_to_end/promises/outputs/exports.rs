//! What other programs read: the fused map and the trajectory in others' forms.
//! `scripts/check_exports.sh` opens the same files with other people's libraries.

use crate::common::room;
use std::path::Path;
use std::process::{Command, Output};

fn export(run: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).arg("export").arg(run).args(arguments).output().unwrap()
}

#[test]
fn every_form_is_written_and_nothing_of_the_run_changes() {
    let run = room().frames(20);
    assert!(run.finish().success());
    let folder = run.dir.path();
    let path = |name: &str| folder.join(name).display().to_string();
    let before = crate::common::OUTPUTS.map(|name| run.output(name));
    let written = std::fs::metadata(run.out().join("map.ply")).unwrap().modified().unwrap();
    let maps = |a: &str, b: &str| {
        let output = export(&run.out(), &["--cloud", &path(a), "--mesh", &path(b), "--voxel-mm", "20"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    let words = maps("a.ply", "m.ply");
    assert!(
        words.contains("a.ply: ") && words.contains(" points") && words.contains(" triangles"),
        "{words}"
    );
    maps("a.pcd", "m.glb");
    let trajectories = export(&run.out(), &["--kitti", &path("k.txt"), "--euroc", &path("e.csv")]);
    assert!(trajectories.status.success());
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(read("a.ply").len() > 27 * 1000 && read("m.ply").len() > read("a.ply").len());
    assert!(read("a.pcd").starts_with(b"# .PCD v0.7") && read("m.glb").starts_with(b"glTF"));
    assert_eq!(read("k.txt").split(|byte| *byte == b'\n').count(), 21);
    assert_eq!(read("e.csv").split(|byte| *byte == b'\n').count(), 22);

    let first = read("m.ply");
    maps("a.ply", "m.ply");
    assert!(read("m.ply") == first, "the same map is the same bytes");
    assert!(crate::common::OUTPUTS.map(|name| run.output(name)) == before);
    let now = std::fs::metadata(run.out().join("map.ply")).unwrap().modified().unwrap();
    assert_eq!(now, written, "outputs that were not asked for are not written");
}

#[test]
fn what_cannot_be_is_told_and_leaves_no_file() {
    let run = room().frames(6);
    assert!(run.finish().success());
    let path = |name: &str| run.dir.path().join(name).display().to_string();
    let cases: [(&[&str], &str); 4] = [
        (&["--mesh", &path("m.obj")], "expected a name that ends in .ply or .glb"),
        (&["--cloud", &path("c.ply"), "--voxel-mm", "0"], "found 0, expected more than 0"),
        (&["--mesh", &path("m.ply"), "--voxel-mm", "1", "--memory-mb", "1"], "--voxel-mm, --memory-mb"),
        (&["--mesh", &path("m.ply"), "--max-depth-m", "far"], "\"far\" is no number"),
    ];
    for (arguments, expected) in cases {
        let output = export(&run.out(), arguments);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {words}");
        assert!(words.contains(expected), "{arguments:?}: {words}");
    }
    assert!(["m.obj", "m.ply", "c.ply"].iter().all(|name| !run.dir.path().join(name).exists()));
    assert_eq!(export(&run.out(), &["--kitti", "/no/where/k.txt"]).status.code(), Some(4));
}
