//! Six lock files, one version of what they share: what one was tested with is what the others run.

use crate::{APART, root};
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

/// The part of a version that must be equal for two of them to be one crate to cargo.
fn series(version: &str) -> String {
    let parts: Vec<&str> = version.split(['.', '+', '-']).take(3).collect();
    let n_leading = parts.iter().take_while(|part| **part == "0").count();
    parts[..=n_leading.min(parts.len() - 1)].join(".")
}

#[test]
fn what_the_lock_files_share_is_of_one_version() {
    let mut versions: BTreeMap<(String, String), BTreeMap<String, BTreeSet<&str>>> = BTreeMap::new();
    for workspace in APART.iter().chain(&["."]) {
        let text = fs::read_to_string(root().join(workspace).join("Cargo.lock")).unwrap();
        let lock: toml::Table = text.parse().unwrap();
        for package in lock["package"].as_array().unwrap().iter().filter(|p| p.get("source").is_some()) {
            let [name, version] = ["name", "version"].map(|key| package[key].as_str().unwrap().to_owned());
            let of = versions.entry((name, series(&version))).or_default();
            of.entry(version).or_default().insert(workspace);
        }
    }
    assert!(versions.len() > 500, "{} crates were found", versions.len());
    versions.retain(|_, versions| versions.len() > 1);
    assert!(
        versions.is_empty(),
        "expected one version, by `cargo update -p NAME --precise VERSION`: {versions:#?}"
    );
}

#[test]
fn a_series_is_what_cargo_takes_for_one() {
    for (version, of) in [("1.2.3", "1"), ("0.2.3", "0.2"), ("0.0.3", "0.0.3"), ("1.2.1+spec-1.1.0", "1")] {
        assert_eq!(series(version), of);
    }
}

#[test]
fn the_minimum_rust_version_is_stated_alike() {
    let stated = |text: &str| {
        let line = text.lines().find(|line| line.starts_with("rust-version = ")).unwrap();
        line.split('"').nth(1).unwrap().to_owned()
    };
    let read = |name: &str| fs::read_to_string(root().join(name)).unwrap();
    let version = stated(&read("Cargo.toml"));
    for page in ["README.md", "docs/first_run.md"] {
        assert!(read(page).contains(&format!("({version} or newer)")), "{page} does not name Rust {version}");
    }
    // The viewer needs what Rerun needs, and its page says so.
    for name in APART.iter().filter(|name| **name != "view") {
        assert_eq!(stated(&read(&format!("{name}/Cargo.toml"))), version, "{name}");
    }
    let of_viewer = stated(&read("view/Cargo.toml"));
    assert!(
        read("docs/viewer.md").contains(&format!("Rust {of_viewer}")),
        "docs/viewer.md: Rust {of_viewer}"
    );
}

/// `scripts/package.sh` builds both into one folder: with another profile each crate would be compiled twice.
#[test]
fn the_wheel_is_built_by_the_profile_of_the_workspace() {
    let table = |name: &str| fs::read_to_string(root().join(name)).unwrap().parse::<toml::Table>().unwrap();
    let lock = table("python/Cargo.lock");
    let is_there = |name: &str| {
        lock["package"].as_array().unwrap().iter().any(|package| package["name"].as_str() == Some(name))
    };
    let [mut of_workspace, of_wheel] =
        ["Cargo.toml", "python/Cargo.toml"].map(|name| table(name)["profile"]["release"].clone());
    let packages = of_workspace.get_mut("package").and_then(|packages| packages.as_table_mut()).unwrap();
    packages.retain(|name, _| is_there(name));
    assert_eq!(of_wheel, of_workspace);
}
