//! Images of a folder that are listed, and those that are there.

use super::files::Files;
use super::list::ListEntry;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Colour images that are there; a warning on the others. A frame goes without its colour.
pub(super) fn that_are_there(
    all: &Files,
    colour: Vec<ListEntry>,
    warnings: &mut Vec<String>,
) -> Vec<ListEntry> {
    let n = colour.len();
    let (there, gone): (Vec<_>, Vec<_>) = colour.into_iter().partition(|entry| all.is_file(&entry.file));
    if let Some(first) = gone.first() {
        warnings.push(format!(
            "{} of {n} colour images are not there, the first: {}; depth alone is used without them",
            gone.len(),
            first.file.display()
        ));
    }
    there
}

/// A warning on a depth image that is listed at two times: at one of them the camera was elsewhere.
pub(super) fn listed_twice(depth: &[ListEntry]) -> Option<String> {
    let mut seen = BTreeSet::new();
    let again: Vec<&ListEntry> = depth.iter().filter(|entry| !seen.insert(&entry.file)).collect();
    let first = again.first()?.file.display();
    Some(format!("{} depth images are listed at more than one time, the first: {first}", again.len()))
}

/// Confidence images of the first `n` frames that are there; a warning on the others.
pub(super) fn confidence(
    all: &Files,
    files: Vec<PathBuf>,
    n: usize,
    warnings: &mut Vec<String>,
) -> Vec<Option<PathBuf>> {
    let there: Vec<Option<PathBuf>> =
        files.into_iter().take(n).map(|file| all.is_file(&file).then_some(file)).collect();
    let n_gone = there.iter().filter(|file| file.is_none()).count();
    if n_gone > 0 {
        warnings.push(format!(
            "{n_gone} of {} confidence images are not there: all depth of their frames is used",
            there.len()
        ));
    }
    there
}
