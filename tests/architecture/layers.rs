//! The house of the SLAM crate: each folder knows those below it alone.

use crate::{code, lines_with};
use std::collections::BTreeSet;

/// Folders of `shared/method/slam/src` from the ground up; the step of a frame and what holds its state are on top.
const LAYERS: [&str; 11] = [
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
];
const SOURCES: &str = "shared/method/slam/src";

#[test]
fn no_arrow_of_the_slam_crate_points_up() {
    let layer = |name: &str| LAYERS.iter().position(|layer| *layer == name);
    let (mut found, mut up) = (BTreeSet::new(), Vec::new());
    for (path, text) in code(SOURCES) {
        let inner = path.strip_prefix(SOURCES).unwrap().to_str().unwrap();
        let of = inner.split('/').next().unwrap().trim_end_matches(".rs");
        if of == "lib" {
            continue;
        }
        let own = layer(of).unwrap_or_else(|| panic!("{inner}: is in no layer"));
        found.insert(of.to_owned());
        for line in lines_with(&text, &["crate::"]) {
            for named in line.split("crate::").skip(1) {
                let name = named.split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or_default();
                if layer(name).is_some_and(|other| other > own) {
                    up.push(format!("{inner}: {}", line.trim()));
                }
            }
        }
    }
    assert!(up.is_empty(), "{up:#?}");
    assert_eq!(found.len(), LAYERS.len(), "each layer has files: {found:?}");
}
