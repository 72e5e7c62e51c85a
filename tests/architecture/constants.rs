//! The numbers that the SLAM crate decides with: fewer, never more.

use crate::code;

/// Numeric constants of `shared/method/slam` outside of tests, fields of settings aside. Lower it with each
/// one that is derived or estimated instead; 80 is the aim.
const MOST_CONSTANTS: usize = 160;

/// Whether a line defines a constant that is a number, or several.
fn is_number(line: &str) -> bool {
    let line = line.trim_start();
    let line = line.strip_prefix("pub(crate) ").or_else(|| line.strip_prefix("pub ")).unwrap_or(line);
    let Some((name, value)) = line.strip_prefix("const ").and_then(|rest| rest.split_once(": ")) else {
        return false;
    };
    let kind = value.trim_start_matches('[');
    let numbers = ["f32", "f64", "usize", "u8", "u32", "u64", "i32", "i64"];
    name.chars().all(|c| c.is_ascii_uppercase() || c == '_' || c.is_ascii_digit())
        && numbers.iter().any(|number| kind.starts_with(number))
}

#[test]
fn the_method_decides_with_no_more_numbers_than_before() {
    // Modules that are compiled for tests alone.
    let is_test = |name: &str| name.starts_with("test_") || name.ends_with("_tests");
    let n = code("shared/method/slam/src")
        .iter()
        .filter(|(path, _)| !path.file_stem().and_then(|name| name.to_str()).is_some_and(is_test))
        .flat_map(|(_, text)| text.lines())
        .filter(|l| is_number(l))
        .count();
    assert!(n > 0 && n <= MOST_CONSTANTS, "{n} numeric constants, at most {MOST_CONSTANTS}");
}

#[test]
fn a_constant_is_told_from_what_is_none() {
    assert!(is_number("    pub(crate) const FAR_M: f64 = 1.0;") && is_number("const N: [i32; 2] = [1, 3];"));
    assert!(
        !is_number("const fn step(quantity: usize) -> f64 {") && !is_number("const NAME: &str = \"f64\";")
    );
}
