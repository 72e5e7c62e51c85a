//! One name for one thing: a type's name says which type it is, wherever it is read.

use crate::{all_crates, code, is_for_developers};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Words before the name of a type of our own.
const KEYWORDS: [&str; 4] = ["struct ", "enum ", "trait ", "type "];

/// Name of the type that a line at the margin of a file defines; `None` where it defines none.
fn defined(line: &str) -> Option<&str> {
    let line = match line.strip_prefix("pub(") {
        Some(scope) => scope.split_once(") ")?.1,
        None => line.strip_prefix("pub ").unwrap_or(line),
    };
    let rest = KEYWORDS.iter().find_map(|keyword| line.strip_prefix(keyword))?;
    rest.split(|c: char| !c.is_alphanumeric()).next()
}

#[test]
fn no_two_types_have_the_same_name() {
    let mut places: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for name in all_crates() {
        for (path, text) in code(&name).into_iter().filter(|(path, _)| !is_for_developers(path)) {
            for name in text.lines().filter_map(defined) {
                places.entry(name.to_owned()).or_default().push(path.clone());
            }
        }
    }
    assert!(places.len() > 300, "{} types were found", places.len());
    places.retain(|_, places| places.len() > 1);
    assert!(places.is_empty(), "names of several types: {places:#?}");
}

#[test]
fn definitions_are_found_in_every_scope() {
    for line in ["struct A;", "pub struct A<T> {", "pub(crate) enum A {", "pub(in crate::b) type A = B;"] {
        assert_eq!(defined(line), Some("A"), "{line}");
    }
    assert_eq!(defined("    type A = B;"), None, "an associated type has its trait's name before it");
}
