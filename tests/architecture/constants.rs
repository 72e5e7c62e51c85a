//! The numbers that the SLAM crate decides with: fewer, never more.

use crate::code;

/// Constants of `shared/method/slam` outside of tests that are numbers or hold some, derived ones too; fields of
/// settings aside. Lower it with each one that is derived or estimated instead; 80 is the aim.
const MOST_CONSTANTS: usize = 115;

/// Whether an item, from its line on, is a constant with a number in its value, of whatever type it is.
fn holds_a_number(item: &str) -> bool {
    let item = item.trim_start();
    let item =
        item.strip_prefix("pub").map_or(item, |rest| rest.split_once(' ').map_or(rest, |(_, rest)| rest));
    let name = item.strip_prefix("const ").or_else(|| item.strip_prefix("static "));
    let Some((name, rest)) = name.and_then(|rest| rest.split_once(": ")) else { return false };
    let is_name = |c: char| c.is_ascii_uppercase() || c == '_' || c.is_ascii_digit();
    let text = rest.lines().map(|line| line.split("//").next().unwrap_or_default());
    let text: String = text.collect::<Vec<_>>().join(" ");
    let value = text.split_once('=').map_or("", |(_, value)| value);
    let value = value.split_once("; ").map_or(value, |(value, _)| value);
    let words = value.split(|c: char| !(c.is_ascii_alphanumeric() || c == '_' || c == '"'));
    name.chars().all(is_name) && words.into_iter().any(|w| w.starts_with(|c: char| c.is_ascii_digit()))
}

/// How many such items a file has.
fn count(text: &str) -> usize {
    let starts = text.match_indices('\n').map(|(at, _)| at + 1).chain([0]);
    starts.filter(|at| holds_a_number(&text[*at..])).count()
}

#[test]
fn the_method_decides_with_no_more_numbers_than_before() {
    // Modules that are compiled for tests alone.
    let is_test = |name: &str| name.starts_with("test_") || name.ends_with("_tests");
    let n: usize = code("shared/method/slam/src")
        .iter()
        .filter(|(path, _)| !path.file_stem().and_then(|name| name.to_str()).is_some_and(is_test))
        .map(|(_, text)| count(text))
        .sum();
    assert!(n > 0 && n <= MOST_CONSTANTS, "{n} numeric constants, at most {MOST_CONSTANTS}");
}

#[test]
fn a_constant_is_told_from_what_is_none() {
    let some = "    pub(crate) const FAR_M: f64 = 1.0;\nconst N: [i32; 2] = [1, 3];\nstatic V: (f64, u8) = (1.0, 2);
pub const STRICT: Limits =\n    Limits { share: 0.3 };\nconst VOLUME: f64 = {\n    let ball = 4.0 * PI;\n    ball\n};\n";
    assert_eq!(count(some), 5);
    let none = "const fn step(n: usize) -> f64 {\n    1.0\n}\nconst NAME: &str = \"f64\";\nconst V: Limits = Limits { m: W::M };
const ONE: u32 = u32::MAX; // 1\nconst KEPT: [Kind; 3] = [Kind::A, Kind::B, Kind::C];\nlet n: usize = 3;\n";
    assert_eq!(count(none), 0);
}
