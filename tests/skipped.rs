//! Count of the tests that were skipped, wholly or in part, for want of something: the last lines of the
//! tests of this package. A program of its own, without a harness, for what tests print is hidden.

#[path = "requirements.rs"]
mod requirements;

use std::collections::BTreeMap;

fn main() {
    let list = requirements::skipped_list();
    let text = std::fs::read_to_string(&list).unwrap_or_default();
    let _ = std::fs::remove_file(&list);
    let mut counts: BTreeMap<&str, u32> = BTreeMap::new();
    text.lines().for_each(|requirement| *counts.entry(requirement).or_default() += 1);
    let n: u32 = counts.values().sum();
    if n == 0 {
        println!("\nno test was skipped\n");
        return;
    }
    let words: Vec<String> = counts.iter().map(|(requirement, n)| format!("{requirement} {n}")).collect();
    println!("\nskipped, wholly or in part, for want of something: {n} ({})", words.join(", "));
    println!("these count as passed; TESSERA_REQUIRE makes them fail (tests/requirements.rs)\n");
}
