//! Files of a folder by name and number, and small text files.

use super::super::files::Files;
use super::super::list::ListEntry;
use super::super::names::nanos_of;
use crate::SourceError;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};
use tessera_evaluation::plain_text;
use tessera_frames::{decode, large};
use tessera_geometry::Camera;

/// Names of all entries, sorted; none where the folder cannot be read. Hidden ones are of the system: macOS
/// writes a `._NAME` beside each file.
pub(in crate::folder) fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).map(|entries| entries.flatten().collect::<Vec<_>>());
    let mut names: Vec<String> =
        entries.unwrap_or_default().iter().map(|entry| entry.file_name().to_string_lossy().into()).collect();
    names.retain(|name| !is_hidden(name));
    names.sort_unstable();
    names
}

pub(in crate::folder) fn is_hidden(name: &str) -> bool {
    name.starts_with('.')
}

/// The file of that name in a folder, in capitals too where there is one such file.
pub(super) fn find(folder: &Path, name: &str) -> PathBuf {
    let exact = folder.join(name);
    if exact.exists() {
        return exact;
    }
    let same: Vec<String> =
        names(folder).into_iter().filter(|other| other.eq_ignore_ascii_case(name)).collect();
    match &same[..] {
        [one] => folder.join(one),
        _ => exact,
    }
}

/// A file whose name holds a number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Numbered {
    pub(super) number: u64,
    /// Relative to the folder of the recording.
    pub(super) file: PathBuf,
}

/// Files `sub/PREFIX NUMBER SUFFIX` of a folder, by number; a suffix is one of several.
pub(super) fn numbered(folder: &Path, sub: &str, prefix: &str, suffixes: &[&str]) -> Vec<Numbered> {
    numbered_of(&names(&folder.join(sub)), sub, prefix, suffixes)
}

/// As [`numbered`], among the names in `sub`.
pub(super) fn numbered_of(names: &[String], sub: &str, prefix: &str, suffixes: &[&str]) -> Vec<Numbered> {
    let number = |name: &str| -> Option<u64> {
        let rest = name.strip_prefix(prefix)?;
        suffixes.iter().find_map(|suffix| rest.strip_suffix(suffix)?.parse().ok())
    };
    let mut found: Vec<Numbered> = names
        .iter()
        .filter_map(|name| Some(Numbered { number: number(name)?, file: Path::new(sub).join(name) }))
        .collect();
    found.sort_by_key(|numbered| numbered.number);
    found.dedup_by_key(|numbered| numbered.number);
    found
}

/// Images without their times.
pub(super) fn unset(images: &[Numbered]) -> Vec<ListEntry> {
    images.iter().map(|image| ListEntry { stamp_nanos: 0, file: image.file.clone() }).collect()
}

/// Time of frame `number`, nanoseconds.
pub(super) fn number_nanos(number: u64, fps: f64) -> i64 {
    nanos_of(number as f64 / fps)
}

/// A whole number of things; `None` of what is none.
#[expect(clippy::cast_possible_truncation, reason = "a number from 0 to below 2^32")]
pub(super) fn count(number: f64) -> Option<usize> {
    (0.0..4_294_967_296.0).contains(&number).then_some(number as usize)
}

/// Refuses a layout without depth.
pub(super) fn some_depth(
    depth: Vec<ListEntry>,
    folder: &Path,
    expected: &str,
) -> Result<Vec<ListEntry>, SourceError> {
    match depth.is_empty() {
        true => Err(wrong(folder, format!("no depth images, expected {expected}"))),
        false => Ok(depth),
    }
}

/// Something that is not as the layout says.
pub(super) fn wrong(path: &Path, reason: impl Into<String>) -> SourceError {
    SourceError::Layout { path: path.to_owned(), reason: reason.into() }
}

/// Columns and rows of the first of some images of a folder that can be read.
pub(super) fn size_of(folder: &Path, images: &[ListEntry]) -> Result<(u32, u32), SourceError> {
    size_in(&Files::folder(folder), images)
}

/// As [`size_of`], wherever the files are.
pub(super) fn size_in(files: &Files, images: &[ListEntry]) -> Result<(u32, u32), SourceError> {
    let mut first = None;
    for entry in images.iter().take(5) {
        match files.read(&entry.file).and_then(|bytes| decode::size(&bytes)) {
            Ok(size) => return Ok(size),
            Err(error) => first = first.or(Some(format!(" ({}: {error})", entry.file.display()))),
        }
    }
    let why = first.unwrap_or_default();
    Err(wrong(
        files.root(),
        format!("none of the first depth images can be read, expected PNG, TIFF, PGM, NPY or OpenEXR{why}"),
    ))
}

/// A pinhole without distortion.
pub(super) fn pinhole(
    size: (u32, u32),
    intrinsics: [f64; 4],
    units_per_metre: f64,
    path: &Path,
) -> Result<Camera, SourceError> {
    let camera = Camera::pinhole(size, intrinsics, units_per_metre);
    large::check_camera(&camera)
        .map_err(|source| SourceError::CameraValue { file: path.display().to_string(), source })?;
    Ok(camera)
}

/// Reads a text file.
pub(super) fn text(path: &Path) -> Result<String, SourceError> {
    let bytes = std::fs::read(path).map_err(|source| SourceError::Io { path: path.to_owned(), source })?;
    Ok(plain_text(&bytes))
}

/// Reads a JSON file.
pub(super) fn json<T: DeserializeOwned>(path: &Path) -> Result<T, SourceError> {
    serde_json::from_str(&text(path)?).map_err(|error| wrong(path, error.to_string()))
}

/// The numbers of a text, which may be separated by commas or semicolons.
pub(super) fn numbers(text: &str, path: &Path) -> Result<Vec<f64>, SourceError> {
    let words =
        text.split(|c: char| c.is_whitespace() || c == ',' || c == ';').filter(|word| !word.is_empty());
    words
        .map(|word| {
            // `inf` and `nan` are words of C too: poses that are not known.
            word.parse().map_err(|_| wrong(path, format!("found '{word}', expected a number")))
        })
        .collect()
}
