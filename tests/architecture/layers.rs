//! Crates with folders: each folder knows those below it alone.

use crate::{code, is_for_developers, lines_with};
use std::collections::BTreeSet;

/// Sources of a crate, and their folders and files from the ground up.
const LAYERED: [(&str, &[&str]); 3] = [
    // The step of a frame and what holds its state are on top.
    (
        "shared/method/slam/src",
        &[
            "settings",
            "estimation",
            "map",
            "pairs",
            "evidence",
            "tracking",
            "submaps",
            "optimise",
            "merging",
            "step",
            "tracker",
        ],
    ),
    (
        "fleet/src",
        &["error", "wire", "robot", "copies", "map", "base", "chaos", "arguments", "looking", "main"],
    ),
    (
        "ros2/src",
        &[
            "carrier",
            "error",
            "report",
            "network",
            "run",
            "poses",
            "map",
            "arguments",
            "camera",
            "services",
            "joined",
            "bridge",
            "ros_arguments",
            "main",
        ],
    ),
];

#[test]
fn no_arrow_of_a_crate_with_folders_points_up() {
    for (sources, layers) in LAYERED {
        let layer = |name: &str| layers.iter().position(|layer| *layer == name);
        let (mut found, mut up) = (BTreeSet::new(), Vec::new());
        for (path, text) in code(sources).into_iter().filter(|(path, _)| !is_for_developers(path)) {
            let inner = path.strip_prefix(sources).unwrap().to_str().unwrap();
            let of = inner.split('/').next().unwrap().trim_end_matches(".rs");
            if of == "lib" {
                continue;
            }
            let own = layer(of).unwrap_or_else(|| panic!("{sources}/{inner}: is in no layer"));
            found.insert(of.to_owned());
            for line in lines_with(&text, &["crate::"]) {
                for named in line.split("crate::").skip(1) {
                    let name =
                        named.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default();
                    if layer(name).is_some_and(|other| other > own) {
                        up.push(format!("{sources}/{inner}: {}", line.trim()));
                    }
                }
            }
        }
        assert!(up.is_empty(), "{up:#?}");
        assert_eq!(found.len(), layers.len(), "each layer of {sources} has files: {found:?}");
    }
}
