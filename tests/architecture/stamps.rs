//! Times of sensors come from outside, from both ends of their range: their differences saturate.

use crate::{all_crates, code, is_for_developers};

/// Operands of minus and plus in a line, as far as they are one word each.
fn operands(line: &str) -> impl Iterator<Item = [&str; 2]> + '_ {
    let is_word = |c: char| c.is_alphanumeric() || "_.()[]*&".contains(c);
    let signs = [" - ", " + "].into_iter().flat_map(|sign| line.match_indices(sign));
    signs.map(move |(at, sign)| {
        let before = &line[..at];
        let before = &before[before.rfind(|c| !is_word(c)).map_or(0, |k| k + 1)..];
        let after = &line[at + sign.len()..];
        [before, &after[..after.find(|c| !is_word(c)).unwrap_or(after.len())]]
    })
}

/// Whether a word names a time in nanoseconds.
fn is_stamp(word: &str) -> bool {
    let last = word.trim_matches(['(', ')', '*', '&']).rsplit('.').next().unwrap_or_default();
    let name = last.split(['[', '(']).next().unwrap_or_default();
    ["stamp_nanos", "stamps_nanos", "stamp", "at_nanos", "from_nanos", "to_nanos", "now_nanos"]
        .contains(&name)
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
fn a_difference_of_stamps_is_seen() {
    for line in [
        "let s = (a.stamp_nanos - b.stamp_nanos) as f64;",
        "truth.stamps_nanos[to] - truth.stamps_nanos[from]",
        "(stamp - from) as f64",
        "estimate.stamps_nanos[at] + offset_nanos",
        "(at_nanos - t0) as f64",
    ] {
        assert!(unsaturated(line), "{line}");
    }
    for line in ["a.stamp_nanos.saturating_sub(b)", "exposure.stamp_s - lag_s", "// stamp - from", "end - at"]
    {
        assert!(!unsaturated(line), "{line}");
    }
}
