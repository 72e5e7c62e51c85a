//! A release is tagged by a script that refuses what is not ready.

use crate::root;
use std::process::{Command, Output};

fn release(arguments: &[&str]) -> Output {
    Command::new("bash").arg("scripts/release.sh").args(arguments).current_dir(root()).output().unwrap()
}

#[test]
fn a_release_of_another_version_is_refused_and_a_short_check_tags_nothing() {
    let refused = release(&["9.9.9", "--dry-run", "--quick"]);
    let words = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{words}");
    for file in ["Cargo.toml", "fleet/Cargo.toml", "python/pyproject.toml", "Cargo.lock", "view/Cargo.lock"] {
        let expected = format!("{file}: found {}", env!("CARGO_PKG_VERSION"));
        assert!(words.contains(&expected), "{expected}: {words}");
    }
    assert!(words.contains("CHANGELOG.md: expected '## 9.9.9, YEAR-MONTH-DAY'"), "{words}");
    let tagging = release(&["9.9.9", "--quick"]);
    assert_eq!(tagging.status.code(), Some(2), "{}", String::from_utf8_lossy(&tagging.stderr));
}
