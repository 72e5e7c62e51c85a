//! Folders of bags of ROS 2, as `ros2 bag record` leaves them.

use crate::common::ros::{camera_info, image, write};
use std::path::Path;
use std::process::{Command, Output};

fn check(source: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).arg("check").arg(source).output().unwrap()
}

/// Text in one line: it may be broken anywhere.
fn said(output: &Output) -> String {
    let text = String::from_utf8([&output.stdout[..], &output.stderr[..]].concat()).unwrap();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn metadata(storage: &str, files: &[&str]) -> String {
    let files: String = files.iter().map(|file| format!("    - {file}\n")).collect();
    format!(
        "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: {storage}\n  relative_file_paths:\n{files}  duration:\n    nanoseconds: 1\n"
    )
}

#[test]
fn several_files_of_a_bag_are_one_recording() {
    let bag = tempfile::tempdir().unwrap();
    let depth = |seconds| image("/depth", seconds, "16UC1");
    write(&bag.path().join("b_0.mcap"), &[camera_info("/depth/info", "plumb_bob", &[]), depth(1), depth(2)]);
    // The second file has no camera of its own, and begins with what the first has too.
    write(&bag.path().join("b_1.mcap"), &[depth(2), depth(3), depth(5)]);
    std::fs::write(bag.path().join("metadata.yaml"), metadata("mcap", &["b_0.mcap", "b_1.mcap"])).unwrap();
    let output = check(bag.path());
    let text = said(&output);
    assert!(output.status.success(), "{text}");
    for part in ["frames 4 in 4.0 s", "depth /depth", "camera /depth/info", "files 2", "colour none"] {
        assert!(text.contains(part), "{text} lacks {part}");
    }
    // Without the list, all files of MCAP.
    std::fs::remove_file(bag.path().join("metadata.yaml")).unwrap();
    assert!(said(&check(bag.path())).contains("frames 4 in 4.0 s"));
}

#[test]
fn a_database_that_is_no_bag_and_a_bag_of_another_version_are_named() {
    let bag = tempfile::tempdir().unwrap();
    let table: [(&str, &[u8], &str); 3] = [
        ("b_0.db3", b"SQLite format 3\0", "an SQLite database that was cut within its header"),
        ("old.bag", b"#ROSBAG V1.2\n", "begins with '#ROSBAG V1.2\\n', expected '#ROSBAG V2.0"),
        ("empty.bag", b"#ROSBAG V2.0\n", "there are: no image topics"),
    ];
    for (name, content, words) in table {
        let file = bag.path().join(name);
        std::fs::write(&file, content).unwrap();
        let output = check(&file);
        let text = said(&output);
        assert_eq!(output.status.code(), Some(3), "{text}");
        assert!(text.contains(words) && text.contains(name), "{text}");
    }
}
