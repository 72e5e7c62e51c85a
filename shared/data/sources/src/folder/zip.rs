//! Files inside a zip file: stored or deflated, of any size.

use crate::{ImageError, SourceError};
use flate2::Crc;
use flate2::read::DeflateDecoder;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

const END: &[u8] = b"PK\x05\x06";
const END_64: &[u8] = b"PK\x06\x06";
const LOCATOR_64: &[u8] = b"PK\x06\x07";
const ENTRY: &[u8] = b"PK\x01\x02";
const FILE: &[u8] = b"PK\x03\x04";
/// Bytes of these records without what varies.
const END_BYTES: usize = 22;
const LOCATOR_64_BYTES: usize = 20;
const ENTRY_BYTES: usize = 46;
const FILE_BYTES: usize = 30;
/// The end record has a comment of at most 65535 bytes behind it.
const MOST_END_BYTES: u64 = 65_557 + LOCATOR_64_BYTES as u64;
/// The list of files, and a file, may take this many bytes.
const MOST_BYTES: u64 = 256 << 20;
/// A field that stands for: see the 64-bit one.
const IN_64: u64 = 0xffff_ffff;
const STORED: u64 = 0;
const DEFLATED: u64 = 8;

/// A zip file by the names of what is in it.
#[derive(Clone, Debug)]
pub(super) struct ZipFile {
    file: Arc<File>,
    entries: Arc<BTreeMap<PathBuf, ZipEntry>>,
}

/// A file in it.
#[derive(Clone, Copy, Debug)]
struct ZipEntry {
    at: u64,
    n_stored: u64,
    n_bytes: u64,
    method: u64,
    crc: u64,
    is_encrypted: bool,
}

/// Whether these bytes begin a zip file.
pub(crate) fn begins(bytes: &[u8]) -> bool {
    bytes.starts_with(FILE)
}

impl ZipFile {
    /// Reads the list of files. A folder that holds all of them is left out of their names.
    ///
    /// # Errors
    /// The file cannot be read, or has no whole list at its end.
    pub(super) fn open(path: &Path) -> Result<Self, SourceError> {
        let io = |source| SourceError::Io { path: path.to_owned(), source };
        let file = File::open(path).map_err(io)?;
        let n_bytes = file.metadata().map_err(io)?.len();
        let entries = directory(&file, n_bytes).map_err(io)?.and_then(|bytes| entries(&bytes));
        let entries = entries.ok_or_else(|| SourceError::Layout {
            path: path.to_owned(),
            reason: format!(
                "{n_bytes} bytes without a whole list of files at their end, expected a zip file: is it cut short?"
            ),
        })?;
        Ok(Self { file: Arc::new(file), entries: Arc::new(without_root(entries)) })
    }

    pub(super) fn is_file(&self, name: &Path) -> bool {
        self.entries.contains_key(name)
    }

    /// Names of the files in a folder.
    pub(super) fn names(&self, folder: &str) -> Vec<String> {
        let inside = self.entries.keys().filter(|name| name.parent() == Some(Path::new(folder)));
        inside.filter_map(|name| Some(name.file_name()?.to_string_lossy().into_owned())).collect()
    }

    /// A file, decompressed and checked.
    ///
    /// # Errors
    /// It is not there, is damaged, or is stored in a way that is not read.
    pub(super) fn read(&self, name: &Path) -> Result<Vec<u8>, ImageError> {
        let entry = self.entries.get(name).ok_or_else(|| ImageError::Io(io::ErrorKind::NotFound.into()))?;
        if entry.is_encrypted {
            return Err(damaged("it is encrypted"));
        }
        let head = part(&self.file, entry.at, FILE_BYTES as u64).map_err(ImageError::Io)?;
        let name_and_more = number(&head, 26, 2).zip(number(&head, 28, 2));
        let Some((n_name, n_more)) = name_and_more.filter(|_| head.starts_with(FILE)) else {
            return Err(damaged(&format!("no file begins at byte {}", entry.at)));
        };
        let begin = [FILE_BYTES as u64, n_name, n_more].iter().fold(entry.at, |at, n| at.saturating_add(*n));
        let stored = part(&self.file, begin, entry.n_stored).map_err(ImageError::Io)?;
        let bytes = match entry.method {
            STORED => stored,
            DEFLATED => inflate(&stored, entry.n_bytes)?,
            other => {
                return Err(damaged(&format!("compression {other}, expected 0 (stored) or 8 (deflated)")));
            }
        };
        let mut crc = Crc::new();
        crc.update(&bytes);
        if (bytes.len() as u64, u64::from(crc.sum())) != (entry.n_bytes, entry.crc) {
            return Err(damaged(&format!("{} bytes of another checksum than its list has", bytes.len())));
        }
        Ok(bytes)
    }
}

fn inflate(stored: &[u8], n_bytes: u64) -> Result<Vec<u8>, ImageError> {
    let mut bytes = Vec::new();
    let limit = n_bytes.min(MOST_BYTES).saturating_add(1);
    let read = DeflateDecoder::new(stored).take(limit).read_to_end(&mut bytes);
    read.map_err(|error| damaged(&error.to_string()))?;
    Ok(bytes)
}

/// The list of files, from the end record or the 64-bit one before it; `None`: there is none.
fn directory(file: &File, n_bytes: u64) -> io::Result<Option<Vec<u8>>> {
    let n_tail = n_bytes.min(MOST_END_BYTES);
    let tail = part(file, n_bytes.saturating_sub(n_tail), n_tail)?;
    let Some(at) = tail.windows(END.len()).rposition(|window| window == END) else { return Ok(None) };
    let end = tail.get(at..at.saturating_add(END_BYTES)).unwrap_or_default();
    let mut place = number(end, 16, 4).zip(number(end, 12, 4));
    let locator = at.checked_sub(LOCATOR_64_BYTES).and_then(|from| tail.get(from..at));
    if let Some(locator) = locator.filter(|locator| locator.starts_with(LOCATOR_64))
        && let Some(at) = number(locator, 8, 8)
    {
        let end = part(file, at, 56)?;
        place = number(&end, 48, 8).zip(number(&end, 40, 8)).filter(|_| end.starts_with(END_64));
    }
    let place = place.filter(|(at, n)| at.checked_add(*n).is_some_and(|end| end <= n_bytes));
    place.map(|(at, n)| part(file, at, n)).transpose()
}

/// The files of a list; `None`: it is not whole.
fn entries(mut list: &[u8]) -> Option<BTreeMap<PathBuf, ZipEntry>> {
    let mut entries = BTreeMap::new();
    while !list.is_empty() {
        let head = list.get(..ENTRY_BYTES).filter(|head| head.starts_with(ENTRY))?;
        let n = |at, n| number(head, at, n);
        let [n_name, n_more, n_comment] =
            [28, 30, 32].map(|at| n(at, 2).and_then(|n| usize::try_from(n).ok()));
        let rest = list.get(ENTRY_BYTES..)?;
        let (name, rest) = rest.split_at_checked(n_name?)?;
        let (more, rest) = rest.split_at_checked(n_more?)?;
        list = rest.get(n_comment?..)?;
        // Each field that does not fit 32 bits follows in this order.
        let mut large = extra_64(more).unwrap_or_default();
        let mut or_64 = |value: u64| match (value, large.split_at_checked(8)) {
            (IN_64, Some((value, rest))) => {
                large = rest;
                number(value, 0, 8)
            }
            _ => Some(value),
        };
        let n_bytes = or_64(n(24, 4)?)?;
        let n_stored = or_64(n(20, 4)?)?;
        let at = or_64(n(42, 4)?)?;
        let is_encrypted = n(8, 2)? & 1 == 1;
        let entry = ZipEntry { at, n_stored, n_bytes, method: n(10, 2)?, crc: n(16, 4)?, is_encrypted };
        let name = String::from_utf8_lossy(name);
        if !name.ends_with('/') {
            entries.insert(PathBuf::from(name.as_ref()), entry);
        }
    }
    Some(entries)
}

/// The 64-bit sizes among what follows a name.
fn extra_64(mut more: &[u8]) -> Option<&[u8]> {
    loop {
        let (kind, n) = (number(more, 0, 2)?, usize::try_from(number(more, 2, 2)?).ok()?);
        let (field, rest) = more.get(4..)?.split_at_checked(n)?;
        if kind == 1 {
            return Some(field);
        }
        more = rest;
    }
}

/// Without the one folder that all files are in.
fn without_root(entries: BTreeMap<PathBuf, ZipEntry>) -> BTreeMap<PathBuf, ZipEntry> {
    let root = entries.keys().next().and_then(|first| first.iter().next()).map(PathBuf::from);
    let Some(root) = root.filter(|root| entries.keys().all(|name| name != root && name.starts_with(root)))
    else {
        return entries;
    };
    let shorter = |name: PathBuf| name.strip_prefix(&root).map_or(name.clone(), Path::to_owned);
    entries.into_iter().map(|(name, entry)| (shorter(name), entry)).collect()
}

/// Some bytes of a file, and no more than are there.
fn part(file: &File, at: u64, n: u64) -> io::Result<Vec<u8>> {
    let end =
        at.checked_add(n).filter(|end| n <= MOST_BYTES && file.metadata().is_ok_and(|m| *end <= m.len()));
    let Some(length) = usize::try_from(n).ok().filter(|_| end.is_some()) else {
        let words = format!("{n} bytes at byte {at}, beyond the end of the file");
        return Err(io::Error::new(io::ErrorKind::UnexpectedEof, words));
    };
    let mut bytes = vec![0; length];
    file.read_exact_at(&mut bytes, at)?;
    Ok(bytes)
}

/// A number of `n` bytes, at most eight, lowest first.
fn number(bytes: &[u8], at: usize, n: usize) -> Option<u64> {
    let bytes = bytes.get(at..at.checked_add(n)?)?;
    Some(bytes.iter().rev().fold(0, |value, byte| (value << 8) | u64::from(*byte)))
}

fn damaged(message: &str) -> ImageError {
    ImageError::Damaged { format: "file in a zip file", message: message.to_owned() }
}

#[cfg(test)]
pub(super) mod tests;
