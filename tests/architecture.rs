//! Who may know whom, where unsafe code may stand, and what a result may depend on.
//!
//! ARCHITECTURE.md states these rules in words; a rule that only words keep does not last.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Each crate with the crates of ours that it may know, tests aside. Arrows point one way:
/// processes to shared, shared to `geometry`.
const MAY_KNOW: [(&str, &[&str]); 22] = [
    ("shared/geometry", &[]),
    ("shared/steps", &[]),
    ("shared/surface", &["geometry", "steps"]),
    ("shared/registration", &["geometry", "steps", "surface"]),
    ("shared/calibration", &["geometry", "surface", "registration"]),
    ("shared/recognition", &["surface", "registration"]),
    ("shared/mapping", &["geometry", "steps", "surface", "registration", "calibration", "recognition"]),
    ("shared/trajectory", &["geometry"]),
    ("shared/fusion", &["geometry", "surface"]),
    ("shared/sources", &["geometry", "trajectory"]),
    ("shared/settings", &["geometry", "surface", "registration", "mapping", "sources"]),
    (
        "shared/offline",
        &["geometry", "surface", "registration", "calibration", "mapping", "sources", "trajectory"],
    ),
    ("shared/messages", &["geometry", "steps", "surface"]),
    ("shared/transport", &["messages", "surface"]),
    ("shared/journal", &[]),
    ("shared/report", &[]),
    (
        "shared/stage",
        &["geometry", "steps", "surface", "mapping", "messages", "transport", "journal", "settings"],
    ),
    ("processes/sensor", &["geometry", "messages", "sources", "stage", "steps", "transport"]),
    ("processes/reconstruct", &["messages", "stage", "surface", "transport"]),
    (
        "processes/align",
        &["geometry", "journal", "mapping", "messages", "settings", "stage", "steps", "surface", "transport"],
    ),
    ("processes/optimise", &["journal", "mapping", "messages", "settings", "stage"]),
    (
        "processes/tessera",
        &[
            "align",
            "calibration",
            "fusion",
            "geometry",
            "journal",
            "mapping",
            "messages",
            "offline",
            "optimise",
            "reconstruct",
            "report",
            "sensor",
            "settings",
            "sources",
            "stage",
            "steps",
            "surface",
            "trajectory",
            "transport",
        ],
    ),
];

/// The method: no files, no clock, no processes, no threads but rayon's, no environment.
const ALGORITHMS: [&str; 9] = [
    "geometry",
    "steps",
    "surface",
    "registration",
    "calibration",
    "recognition",
    "mapping",
    "trajectory",
    "fusion",
];

/// The only files with unsafe code, beside `shared/transport`.
const UNSAFE_FILES: [&str; 1] = ["shared/journal/src/mapped.rs"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn crates() -> Vec<String> {
    let mut crates = Vec::new();
    for folder in ["shared", "processes"] {
        for entry in fs::read_dir(root().join(folder)).unwrap() {
            let path = entry.unwrap().path();
            if path.join("Cargo.toml").is_file() {
                crates.push(format!("{folder}/{}", path.file_name().unwrap().to_str().unwrap()));
            }
        }
    }
    crates.sort();
    crates
}

fn dependencies(of: &str) -> BTreeSet<String> {
    let text = fs::read_to_string(root().join(of).join("Cargo.toml")).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    let of_kind =
        |kind: &str| manifest.get(kind).and_then(toml::Value::as_table).cloned().unwrap_or_default();
    let mut all: BTreeSet<String> = of_kind("dependencies").keys().cloned().collect();
    all.extend(of_kind("build-dependencies").keys().cloned());
    all
}

/// Rust files below a folder with their text up to the tests.
fn code(folder: &str) -> BTreeMap<PathBuf, String> {
    let (mut files, mut folders) = (BTreeMap::new(), vec![root().join(folder)]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = fs::read_to_string(&path).unwrap();
                let code = text.split("#[cfg(test)]").next().unwrap_or_default().to_owned();
                files.insert(path.strip_prefix(root()).unwrap().to_owned(), code);
            }
        }
    }
    files
}

/// Lines of code, comments aside, that contain any of the words.
fn lines_with<'a>(text: &'a str, words: &[&str]) -> Vec<&'a str> {
    let is_code = |line: &&str| !line.trim_start().starts_with("//");
    text.lines().filter(is_code).filter(|line| words.iter().any(|word| line.contains(word))).collect()
}

#[test]
fn crates_know_only_whom_they_may() {
    let table: BTreeMap<&str, &[&str]> = MAY_KNOW.into_iter().collect();
    let names: Vec<String> = table.keys().map(ToString::to_string).collect();
    assert_eq!(crates(), names, "each crate has its line in this table and the other way round");
    for (name, allowed) in table {
        let ours = dependencies(name);
        let known = ours.iter().filter_map(|dependency| dependency.strip_prefix("tessera-"));
        for known in known {
            assert!(allowed.contains(&known), "{name} must not know {known}; it may know {allowed:?}");
        }
    }
}

#[test]
fn only_transport_knows_the_middleware() {
    for name in crates() {
        let knows = dependencies(&name).iter().any(|dependency| dependency.starts_with("iceoryx2"));
        assert_eq!(knows, name == "shared/transport", "{name}");
    }
}

#[test]
fn the_method_knows_no_files_no_clock_and_no_threads() {
    let words = [
        "std::fs",
        "std::io",
        "std::time",
        "std::net",
        "std::process",
        "std::thread",
        "std::env",
        "Instant",
        "SystemTime",
    ];
    for name in ALGORITHMS {
        for (path, text) in code(&format!("shared/{name}/src")) {
            // Trajectory files are what one file of that crate is about.
            if path != Path::new("shared/trajectory/src/file.rs") {
                assert_eq!(lines_with(&text, &words), Vec::<&str>::new(), "{}", path.display());
            }
        }
    }
}

/// The C library's functions differ in bits between machines; those of the libm crate do not.
#[test]
fn results_do_not_depend_on_the_machine_s_c_library() {
    let words = [
        ".sin()",
        ".cos()",
        ".tan()",
        ".sin_cos()",
        ".asin()",
        ".acos()",
        ".atan()",
        ".atan2(",
        ".exp()",
        ".ln()",
        ".log10()",
        ".log2()",
        ".powf(",
        ".cbrt()",
        ".hypot(",
        ".mul_add(",
    ];
    for name in ALGORITHMS.iter().chain(&["sources"]) {
        for (path, text) in code(&format!("shared/{name}/src")) {
            assert_eq!(
                lines_with(&text, &words),
                Vec::<&str>::new(),
                "{}: use the libm crate",
                path.display()
            );
        }
    }
}

#[test]
fn unsafe_code_stands_where_it_may_and_nowhere_else() {
    for name in crates() {
        let forbids = ["shared/transport", "shared/journal"].iter().all(|with_unsafe| *with_unsafe != name);
        let level = if forbids { "#![forbid(unsafe_code)]" } else { "#![deny(unsafe_code)]" };
        for (path, text) in code(&name) {
            let file = path.file_name().unwrap().to_str().unwrap();
            let is_root = path.parent().unwrap().ends_with("src") && ["lib.rs", "main.rs"].contains(&file);
            assert!(!is_root || text.contains(level), "{} lacks {level}", path.display());
            let may =
                name == "shared/transport" || UNSAFE_FILES.iter().any(|allowed| path == Path::new(allowed));
            let words = ["unsafe {", "unsafe fn", "unsafe impl", "allow(unsafe_code", "expect(unsafe_code"];
            assert!(may || lines_with(&text, &words).is_empty(), "{} has unsafe code", path.display());
        }
    }
}

#[test]
fn every_crate_and_every_dependency_is_explained() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    for name in crates() {
        assert!(text.contains(&format!("`{name}`")), "ARCHITECTURE.md has no paragraph on `{name}`");
    }
    let manifest: toml::Table = fs::read_to_string(root().join("Cargo.toml")).unwrap().parse().unwrap();
    for dependency in manifest["workspace"]["dependencies"].as_table().unwrap().keys() {
        let is_ours = dependency.starts_with("tessera-");
        assert!(
            is_ours || text.contains(&format!("`{dependency}`")),
            "ARCHITECTURE.md does not say why {dependency}"
        );
    }
}
