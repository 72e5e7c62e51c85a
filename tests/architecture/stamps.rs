//! Times of sensors come from outside, from both ends of their range: their differences saturate.
//!
//! They are plain `i64`, as records and messages hold them. In [`READERS`] any sum or difference of whole numbers is an
//! error of clippy unless an exception states its reason; in all other crates a word that names nanoseconds is found
//! here.

use crate::{all_crates, code, is_for_developers, root};
use std::fs;

/// Where bytes come in from outside.
const READERS: [&str; 17] = [
    "shared/data/evaluation/src/text/mod.rs",
    "shared/data/frames/src/lib.rs",
    "shared/data/recording/src/lib.rs",
    "shared/data/sources/src/lib.rs",
    "shared/runtime/journal/src/lib.rs",
    "shared/runtime/messages/src/lib.rs",
    "shared/runtime/settings/src/lib.rs",
    "shared/runtime/stage/src/lib.rs",
    "shared/runtime/supervisor/src/lib.rs",
    "shared/runtime/transport/src/lib.rs",
    "shared/tools/outputs/src/lib.rs",
    "shared/tools/report/src/lib.rs",
    "processes/align/src/inbox.rs",
    "processes/reconstruct/src/feed.rs",
    "processes/sensor/src/external/mod.rs",
    "fleet/src/lib.rs",
    "ros2/src/main.rs",
];

/// Operands of minus and plus in a line, as far as they are one word each.
fn operands(line: &str) -> impl Iterator<Item = [&str; 2]> + '_ {
    let is_word = |c: char| c.is_alphanumeric() || "_.()[]*&".contains(c);
    let signs = [" - ", " + "].into_iter().flat_map(|sign| line.match_indices(sign));
    signs.map(move |(at, sign)| {
        let before = &line[..at];
        let before = &before[before.rfind(|c| !is_word(c)).map_or(0, |k| k + 1)..];
        let after = &line[at + sign.len()..];
        let after = &after[..after.find(|c| !is_word(c)).unwrap_or(after.len())];
        [&before[opened(before).map_or(0, |k| k + 1)..], &after[..closed(after).unwrap_or(after.len())]]
    })
}

/// The last bracket that is opened in a word and not closed.
fn opened(word: &str) -> Option<usize> {
    let mut depth = 0;
    word.bytes()
        .enumerate()
        .rev()
        .find(|(_, byte)| is_outside(*byte, b"])", b"[(", &mut depth))
        .map(|(k, _)| k)
}

/// The first bracket that is closed in a word and not opened.
fn closed(word: &str) -> Option<usize> {
    let mut depth = 0;
    word.bytes().position(|byte| is_outside(byte, b"[(", b"])", &mut depth))
}

fn is_outside(byte: u8, inward: &[u8], outward: &[u8], depth: &mut u32) -> bool {
    if inward.contains(&byte) {
        *depth += 1;
    } else if outward.contains(&byte) {
        match depth.checked_sub(1) {
            Some(less) => *depth = less,
            None => return true,
        }
    }
    false
}

/// Whether a word names a time in nanoseconds.
fn is_stamp(word: &str) -> bool {
    let last = word.trim_matches(['(', ')', '*', '&']).rsplit('.').next().unwrap_or_default();
    let name = last.split(['[', '(']).next().unwrap_or_default();
    name == "stamp" || name.ends_with("nanos")
}

fn unsaturated(line: &str) -> bool {
    let line = line.split("//").next().unwrap_or_default();
    operands(line).flatten().any(is_stamp)
}

#[test]
fn differences_of_stamps_saturate() {
    let mut found = Vec::new();
    for name in all_crates() {
        // What is only for a developer may end in an overflow.
        for (path, text) in code(&name).into_iter().filter(|(path, _)| !is_for_developers(path)) {
            let lines = text.lines().enumerate().filter(|(_, line)| unsaturated(line));
            found.extend(lines.map(|(at, line)| format!("{}:{}: {}", path.display(), at + 1, line.trim())));
        }
    }
    assert!(found.is_empty(), "expected saturating_sub or saturating_add: {found:#?}");
}

#[test]
fn readers_of_bytes_from_outside_have_the_lints() {
    let lints = ["unwrap_used", "indexing_slicing", "cast_possible_truncation", "arithmetic_side_effects"];
    let lints = lints.map(|lint| format!("        clippy::{lint}")).join(",\n");
    for reader in READERS {
        let text = fs::read_to_string(root().join(reader)).unwrap();
        assert!(text.contains(&format!("    not(test),\n    deny(\n{lints}\n    )\n")), "{reader}");
    }
}

#[test]
fn a_difference_of_stamps_is_seen() {
    for line in [
        "let s = (a.stamp_nanos - b.stamp_nanos) as f64;",
        "truth.stamps_nanos[to] - truth.stamps_nanos[from]",
        "(stamp - from) as f64",
        "estimate.stamps_nanos[at] + offset_nanos",
        "(at_nanos - t0) as f64",
        "now - contact.last_nanos < limit",
        "f(a.stamp_nanos - b)",
    ] {
        assert!(unsaturated(line), "{line}");
    }
    for line in [
        "a.stamp_nanos.saturating_sub(b)",
        "exposure.stamp_s - lag_s",
        "// stamp - from",
        "end - at",
        "begin_nanos(bucket + 1)",
        "(begun.elapsed() + lasting).as_nanos()",
    ] {
        assert!(!unsaturated(line), "{line}");
    }
}
