//! What tests need beyond a clone and the compiler, and what happens where it is missing.
//!
//! Each crate with such tests includes this file by its path. Without `TESSERA_REQUIRE` a test that
//! lacks something prints that and passes, and `tests/skipped.rs` counts; with it, a list such as `data,python,cc`, it fails.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses a part of it")]

use std::fmt::Display;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Words of `TESSERA_REQUIRE`.
const KNOWN: [&str; 14] = [
    "browser",    // Chromium, for the report
    "cc",         // a compiler of C and of C++
    "data",       // the sequences of ../shared/data
    "glibc",      // a C library that says which instructions it uses
    "namespaces", // unshare --mount, pgrep
    "proc",       // /proc
    "python",     // python3 with venv, pip and a package index
    "rerun",      // Rerun's own command line
    "root",       // setpriv, to become another user
    "systemd",    // systemd-analyze
    "terminal",   // script of util-linux
    "tessera",    // the command, built, for packages that are built apart
    "tools",      // bash, curl, gzip, openssl, tar
    "viewer",     // tessera-view, built
];

/// Says that a test, or a part of it, is skipped; fails where the requirement must be there.
pub fn missing(requirement: &str, why: impl Display) {
    assert!(KNOWN.contains(&requirement), "{requirement} is not in the list of requirements");
    let required = std::env::var("TESSERA_REQUIRE").unwrap_or_default();
    let required: Vec<&str> = required.split(',').map(str::trim).filter(|word| !word.is_empty()).collect();
    let unknown: Vec<&&str> = required.iter().filter(|word| !KNOWN.contains(word)).collect();
    assert!(unknown.is_empty(), "TESSERA_REQUIRE: {unknown:?}, expected some of {KNOWN:?}");
    assert!(!required.contains(&requirement), "TESSERA_REQUIRE has {requirement}: {why}");
    // To standard error itself: what a test that passes prints is not shown.
    let _ = writeln!(std::io::stderr(), "skipped ({requirement}): {why}");
    let list = std::fs::OpenOptions::new().append(true).create(true).open(skipped_list());
    // For the count at the end; the line above is there in any case.
    let _ = list.and_then(|mut list| writeln!(list, "{requirement}"));
}

/// A line for each test that was skipped since the count was last taken.
pub fn skipped_list() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("skipped_tests.txt")
}

/// A sequence, or a file of one: of `tests/data`, else of `data/` in `TESSERA_SHARED`, by default
/// the folder `shared` beside the workspace.
pub fn data(name: &str) -> Option<PathBuf> {
    let mut folders = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors();
    let root = folders.find(|folder| folder.join("tests/requirements.rs").is_file()).unwrap();
    let shared = std::env::var_os("TESSERA_SHARED").map_or_else(|| root.join("../shared"), PathBuf::from);
    let places = [root.join("tests/data").join(name), shared.join("data").join(name)];
    let found = places.into_iter().find(|path| path.exists());
    if found.is_none() {
        missing("data", format_args!("no {name} in tests/data, nor in {}/data", shared.display()));
    }
    found
}
