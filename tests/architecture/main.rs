//! Who may know whom, where unsafe code may stand, and what a result may depend on.
//!
//! ARCHITECTURE.md states these rules in words; a rule that only words keep does not last.

mod constants;
mod layers;
mod locks;
mod names;
mod prose;
mod release;
mod shapes;
mod stamps;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Each wing with the wings that its crates may know, also in their tests and examples. Arrows point down: the method
/// knows nothing but itself, the processes know everything.
const WINGS: [(&str, &[&str]); 5] = [
    ("shared/method", &["shared/method"]),
    ("shared/data", &["shared/data", "shared/method"]),
    ("shared/runtime", &["shared/runtime", "shared/data", "shared/method"]),
    ("shared/tools", &["shared/tools", "shared/runtime", "shared/data", "shared/method"]),
    ("processes", &["processes", "shared/tools", "shared/runtime", "shared/data", "shared/method"]),
];

/// Inside the method: each crate with the crates that it may know, in the order of the paper.
const METHOD: [(&str, &[&str]); 9] = [
    ("geometry", &[]),
    ("numerics", &["geometry"]),
    ("surface", &["geometry", "numerics"]),
    ("features", &["geometry", "numerics"]),
    ("graph", &["geometry", "numerics"]),
    ("registration", &["geometry", "numerics", "surface", "graph"]),
    ("calibration", &["geometry", "numerics", "surface", "graph", "registration"]),
    ("slam", &["geometry", "numerics", "surface", "features", "graph", "registration", "calibration"]),
    ("fusion", &["geometry", "numerics", "surface"]),
];

/// Where in the repository each section and equation of the paper is; ARCHITECTURE.md has the same
/// table.
const PAPER: [(&str, &str); 11] = [
    ("III-A, eq. 1-5", "shared/method/surface/src/mesh.rs"),
    ("III-B, eq. 6-7", "shared/method/surface/src/filter.rs"),
    ("III-C, eq. 8-9", "shared/method/surface/src/normals.rs"),
    ("III-D, eq. 10-11", "shared/method/registration/src/gicp.rs"),
    ("III-E, eq. 12-13", "shared/method/graph/src"),
    ("III-F", "shared/method/slam/src/tracking"),
    ("III-G", "shared/method/slam/src/pairs/verification.rs"),
    ("III-G, all keyframes", "shared/method/slam/src/optimise"),
    ("III-H, eq. 14-15", "shared/method/slam/src/tracking/keyframe_test.rs"),
    ("III-I", "shared/method/registration/src/sampling"),
    ("IV, Table I", "shared/tools/lab/src/ablation"),
];

/// The only files with unsafe code.
const WITH_UNSAFE: [&str; 3] = [
    "shared/method/numerics/src/prefetch.rs",
    "shared/runtime/transport/src/slices.rs",
    "shared/runtime/transport/src/wire.rs",
];

/// Crates outside the workspace, each with a lock file of its own.
const APART: [&str; 5] = ["fleet", "fuzz", "python", "ros2", "view"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The workspace's crates.
fn crates() -> Vec<String> {
    let wings = WINGS.map(|(wing, _)| wing);
    let mut crates: Vec<String> = wings.iter().flat_map(|wing| crates_in(wing)).collect();
    crates.sort();
    crates
}

/// Every crate of the repository but the root's, which has tests alone.
fn all_crates() -> Vec<String> {
    let mut all = crates();
    all.extend(APART.map(str::to_owned));
    all
}

/// Whether a file is there for developers alone: tests, benchmarks and examples.
fn is_for_developers(path: &Path) -> bool {
    let is_named = |part: &str| {
        ["tests", "tests.rs", "benches", "examples"].contains(&part) || part.starts_with("test_")
    };
    path.iter().filter_map(|part| part.to_str()).any(is_named)
}

/// Crates of a wing, as paths from the root.
fn crates_in(wing: &str) -> Vec<String> {
    let mut crates = Vec::new();
    for entry in fs::read_dir(root().join(wing)).unwrap() {
        let path = entry.unwrap().path();
        if path.join("Cargo.toml").is_file() {
            crates.push(format!("{wing}/{}", path.file_name().unwrap().to_str().unwrap()));
        }
    }
    crates.sort();
    crates
}

/// Name of a crate without `tessera-`; that of the command is `command`.
fn package(of: &str) -> String {
    let text = fs::read_to_string(root().join(of).join("Cargo.toml")).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    manifest["package"]["name"].as_str().unwrap().strip_prefix("tessera-").unwrap().to_owned()
}

fn known_of_ours(of: &str) -> Vec<String> {
    let all = dependencies(of);
    all.iter().filter_map(|name| name.strip_prefix("tessera-")).map(str::to_owned).collect()
}

/// Dependencies of one kind, such as `dev-dependencies`.
fn dependencies_of_kind(of: &str, kind: &str) -> BTreeSet<String> {
    let text = fs::read_to_string(root().join(of).join("Cargo.toml")).unwrap();
    let manifest: toml::Table = text.parse().unwrap();
    let table = manifest.get(kind).and_then(toml::Value::as_table).cloned().unwrap_or_default();
    table.keys().cloned().collect()
}

fn dependencies(of: &str) -> BTreeSet<String> {
    let mut all = dependencies_of_kind(of, "dependencies");
    all.extend(dependencies_of_kind(of, "build-dependencies"));
    all
}

/// Rust files below a folder with their text up to the tests.
fn code(folder: &str) -> BTreeMap<PathBuf, String> {
    let up_to_the_tests = |text: String| text.split("#[cfg(test)]").next().unwrap_or_default().to_owned();
    files(folder).into_iter().map(|(path, text)| (path, up_to_the_tests(text))).collect()
}

/// Rust files below a folder with their text.
fn files(folder: &str) -> BTreeMap<PathBuf, String> {
    let (mut files, mut folders) = (BTreeMap::new(), vec![root().join(folder)]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                let text = fs::read_to_string(&path).unwrap();
                files.insert(path.strip_prefix(root()).unwrap().to_owned(), text);
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
fn wings_know_only_the_wings_below_them() {
    let wing_of: BTreeMap<String, &str> = WINGS
        .iter()
        .flat_map(|(wing, _)| crates_in(wing).into_iter().map(|path| (package(&path), *wing)))
        .collect();
    for (wing, allowed) in WINGS {
        for path in crates_in(wing) {
            let in_tests = dependencies_of_kind(&path, "dev-dependencies");
            let in_tests = in_tests.iter().filter_map(|name| name.strip_prefix("tessera-"));
            for known in known_of_ours(&path).into_iter().chain(in_tests.map(str::to_owned)) {
                let other = wing_of[&known];
                assert!(allowed.contains(&other), "{path} must not know {known} of {other}");
            }
        }
        if wing.starts_with("shared/") {
            let readme = fs::read_to_string(root().join(wing).join("README.md")).unwrap();
            assert!(readme.lines().count() <= 7, "{wing}/README.md: five lines or so");
            assert!(readme.contains("may know"), "{wing}/README.md says whom the wing may know");
        }
    }
    let processes = crates_in("processes");
    for path in processes.iter().filter(|path| *path != "processes/tessera") {
        let tools: Vec<String> =
            known_of_ours(path).into_iter().filter(|known| wing_of[known] == "shared/tools").collect();
        assert!(tools.is_empty(), "{path} is a stage and must not know the tools {tools:?}");
    }
}

#[test]
fn the_method_s_crates_know_only_whom_they_may() {
    let table: BTreeMap<&str, &[&str]> = METHOD.into_iter().collect();
    for path in crates_in("shared/method") {
        let name = package(&path);
        let allowed = table.get(name.as_str()).unwrap_or_else(|| panic!("{name} is in no line of METHOD"));
        for known in known_of_ours(&path) {
            assert!(allowed.contains(&known.as_str()), "{name} must not know {known}; may: {allowed:?}");
        }
    }
    assert_eq!(crates_in("shared/method").len(), table.len());
}

#[test]
fn each_section_of_the_paper_has_its_place() {
    let text = fs::read_to_string(root().join("ARCHITECTURE.md")).unwrap();
    for (section, place) in PAPER {
        assert!(root().join(place).exists(), "{section}: there is no {place}");
        let is_told =
            |line: &str| line.starts_with(&format!("| {section} ")) && line.contains(&format!("`{place}`"));
        assert!(text.lines().any(is_told), "ARCHITECTURE.md does not say that {section} is in {place}");
    }
}

/// Sections of docs/method.md: headings such as `## 5.3 Pair blocks`, and traps such as `- T4: ...`.
fn sections_of_the_method() -> BTreeSet<String> {
    let text = fs::read_to_string(root().join("docs/method.md")).unwrap();
    let number = |word: &str| word.trim_end_matches([':', '.']).to_owned();
    let is_number = |word: &str| word.chars().all(|c| c.is_ascii_digit() || c == '.' || c == 'T');
    text.lines()
        .filter(|line| line.starts_with('#') || line.starts_with("- T"))
        .filter_map(|line| line.split_whitespace().nth(1))
        .map(number)
        .filter(|word| is_number(word))
        .collect()
}

#[test]
fn each_reference_to_the_method_s_document_is_found_in_it() {
    let sections = sections_of_the_method();
    assert!(sections.contains("5.3") && sections.contains("T4"), "{sections:?}");
    let mut n_references = 0;
    let apart = APART.map(|name| format!("{name}/src"));
    let here = ["shared", "processes", "tests", "benches"].map(str::to_owned);
    for folder in here.iter().chain(&apart) {
        for (path, text) in files(folder) {
            for (at, _) in text.match_indices("method ") {
                let word =
                    text[at + "method ".len()..].split([' ', ',', ';', ')', '\n', '-']).next().unwrap();
                let word = word.trim_end_matches(['.', ':']);
                let is_reference = word.trim_start_matches('T').starts_with(|c: char| c.is_ascii_digit());
                if is_reference {
                    assert!(sections.contains(word), "{}: method {word}", path.display());
                    n_references += 1;
                }
            }
            for gone in ["SPEC ", "TRAPS "] {
                let is_this_test = path.ends_with("architecture/main.rs");
                assert!(is_this_test || !text.contains(gone), "{} cites {gone}", path.display());
            }
        }
    }
    assert!(n_references > 50, "{n_references} references");
}

#[test]
fn only_transport_knows_the_middleware() {
    for name in all_crates() {
        let knows = dependencies(&name).iter().any(|dependency| dependency.starts_with("iceoryx2"));
        assert_eq!(knows, name == "shared/runtime/transport", "{name}");
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
    for (path, text) in code("shared/method") {
        let is_example = path.components().any(|part| part.as_os_str() == "examples");
        let is_test = path.components().any(|part| part.as_os_str() == "tests");
        if !is_example && !is_test {
            assert_eq!(lines_with(&text, &words), Vec::<&str>::new(), "{}", path.display());
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
    for wing in ["shared/method", "shared/data"] {
        for (path, text) in code(wing) {
            let found = lines_with(&text, &words);
            let is_source =
                path.components().any(|part| part.as_os_str() == "src") && !path.ends_with("tests.rs");
            assert!(!is_source || found.is_empty(), "{}: use the libm crate: {found:?}", path.display());
        }
    }
}

#[test]
fn unsafe_code_stands_where_it_may_and_nowhere_else() {
    for name in all_crates() {
        let forbids = !WITH_UNSAFE.iter().any(|file| file.starts_with(&format!("{name}/")));
        let level = if forbids { "#![forbid(unsafe_code)]" } else { "#![deny(unsafe_code)]" };
        for (path, text) in code(&name) {
            let file = path.file_name().unwrap().to_str().unwrap();
            let is_root = path.parent().unwrap().ends_with("src") && ["lib.rs", "main.rs"].contains(&file);
            assert!(!is_root || text.contains(level), "{} lacks {level}", path.display());
            let words = ["unsafe {", "unsafe fn", "unsafe impl", "allow(unsafe_code", "expect(unsafe_code"];
            let may = WITH_UNSAFE.iter().any(|file| path.ends_with(file));
            assert_eq!(may, !lines_with(&text, &words).is_empty(), "unsafe code in {}", path.display());
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

#[test]
fn a_crate_depends_on_what_its_code_names() {
    for name in all_crates() {
        // Those of the fuzzer are no sources of a library.
        let sources = if name == "fuzz" { name.clone() } else { format!("{name}/src") };
        for (kind, sources) in [("dependencies", &sources), ("dev-dependencies", &name)] {
            let code: String = files(sources).into_values().collect();
            let words: BTreeSet<&str> = code.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
            for dependency in dependencies_of_kind(&name, kind) {
                let word = dependency.replace('-', "_");
                assert!(
                    words.contains(&word[..]),
                    "{name} has {dependency} in its {kind} and does not name it"
                );
            }
        }
    }
}
