//! The end of a journal, torn or damaged.
//!
//! A process that dies, or a machine that loses power, tears the end of a journal: nothing whole lies
//! behind the first byte that is wrong. Whole records behind it mean that something else damaged the
//! file, and cutting there would destroy them.

use crate::error::JournalError;
use crate::framing::{RECORD_HEADER_BYTES, record_header};
use crate::kind::UnreadableRecord;
use crate::scan::{Mark, NoRecord, next_record};
use crate::synced::Synced;
use std::fs::File;
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Treatment of damage before the end of a journal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OnDamage {
    /// An error; the file stays as it is.
    #[default]
    Refuse,
    /// The file is copied to one beside it, then cut before the damage.
    SetAside,
}

/// The first place of a journal without a record that can be used.
#[derive(Debug)]
pub(crate) struct BrokenAt {
    pub(crate) reason: String,
    /// Whole records from there on, the refused one included.
    pub(crate) n_lost: u64,
    /// Bytes that were forced to disk and are not there.
    pub(crate) synced_lost: u64,
    /// A power cut accounts for it: nothing there was ever forced to disk.
    pub(crate) is_unsynced: bool,
}

impl BrokenAt {
    /// Nothing whole lies behind it, and nothing that was on disk is missing.
    pub(crate) fn is_torn_end(&self) -> bool {
        self.n_lost == 0 && self.synced_lost == 0
    }
}

/// Goes over records from `mark` on, each with its version, up to the end or to the first that cannot be used.
pub(crate) fn walk(
    file: &File,
    path: &Path,
    mark: &mut Mark,
    synced: Option<Synced>,
    mut accept: impl FnMut(u32, &[u8]) -> Result<(), UnreadableRecord>,
) -> Result<Option<BrokenAt>, JournalError> {
    let mut payload = Vec::new();
    let (reason, n_refused) = loop {
        match next_record(file, path, mark, &mut payload)? {
            Ok(head) => match accept(head.version, &payload) {
                Ok(()) => *mark = mark.behind(&head),
                Err(UnreadableRecord::Damage(reason)) => break (reason, 1),
                // Whole, and of another program: no damage that might be cut.
                Err(UnreadableRecord::Version { found, expected }) => {
                    return Err(JournalError::Version { path: path.into(), found, expected });
                }
            },
            Err(NoRecord::End) => break ("the file ends there".to_owned(), 0),
            Err(NoRecord::Broken(reason)) => break (reason, 0),
        }
    };
    let synced_lost = synced.as_ref().map_or(0, |synced| synced.len.saturating_sub(mark.end));
    let bytes = bytes_from(file, path, mark.end)?;
    if synced_lost == 0 && bytes.is_empty() {
        return Ok(None);
    }
    let is_unsynced = synced_lost == 0 && synced.is_some_and(|synced| !synced.is_of_this_boot);
    let n_lost = records_behind(&bytes).saturating_add(n_refused);
    Ok(Some(BrokenAt { reason, n_lost, synced_lost, is_unsynced }))
}

/// Number of whole records in `bytes`, which begin where one is broken and end with the file.
///
/// The length of the broken one may be part of the damage, so each place is tried: a record is
/// recognised by its header and by the checksum of its successor, which continues its own.
pub(crate) fn records_behind(bytes: &[u8]) -> u64 {
    let continued = |at: usize| {
        let head = record_header(bytes.get(at..)?)?;
        let next = at.checked_add(RECORD_HEADER_BYTES)?.checked_add(head.len)?;
        Some((next, head.crc)).filter(|_| next <= bytes.len())
    };
    // The broken record's own header may be whole: its successor then continues it.
    if let Some((next, crc)) = continued(0) {
        let n = chain_len(bytes, next, crc);
        if n > 0 {
            return n;
        }
    }
    for at in 1..bytes.len() {
        let Some((next, crc)) = continued(at) else { continue };
        let n = chain_len(bytes, next, crc);
        // One that ends with the file has no successor to vouch for it.
        if n > 0 || next == bytes.len() {
            return n.saturating_add(1);
        }
    }
    0
}

/// Records from `at` on that continue a record with the checksum `link`.
fn chain_len(bytes: &[u8], mut at: usize, mut link: u32) -> u64 {
    let mut n = 0;
    while let Some(head) = bytes.get(at..).and_then(record_header) {
        let begin = at.saturating_add(RECORD_HEADER_BYTES);
        let end = begin.saturating_add(head.len);
        let Some(payload) = bytes.get(begin..end) else { break };
        if !head.is_of(link, payload) {
            break;
        }
        (at, link) = (end, head.crc);
        n = u64::saturating_add(n, 1);
    }
    n
}

/// The bytes of a file from `offset` to its end.
pub(crate) fn bytes_from(file: &File, path: &Path, offset: u64) -> Result<Vec<u8>, JournalError> {
    let len = file.metadata().map_err(JournalError::io("look at", path))?.len().saturating_sub(offset);
    let mut bytes = vec![0; usize::try_from(len).unwrap_or(usize::MAX)];
    file.read_exact_at(&mut bytes, offset).map_err(JournalError::io("read", path))?;
    Ok(bytes)
}

/// Copies a file to `NAME.damaged-N` beside it, forced to disk before this returns.
///
/// # Errors
/// Where the copy cannot be written.
pub fn set_aside(path: &Path) -> Result<PathBuf, JournalError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    for n in 1..u32::MAX {
        let copy = path.with_file_name(format!("{name}.damaged-{n}"));
        let opened = std::fs::OpenOptions::new().write(true).create_new(true).mode(0o600).open(&copy);
        let mut to = match opened {
            Ok(to) => to,
            Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists => continue,
            Err(error) => return Err(JournalError::io("write", &copy)(error)),
        };
        let mut copied = || -> std::io::Result<()> {
            std::io::copy(&mut File::open(path)?, &mut to)?;
            to.sync_all()
        };
        return match copied() {
            Ok(()) => Ok(copy),
            Err(error) => {
                // Half a copy keeps nothing.
                let _ = std::fs::remove_file(&copy);
                Err(JournalError::io("write", &copy)(error))
            }
        };
    }
    Err(JournalError::io("name a copy of", path)(std::io::ErrorKind::AlreadyExists.into()))
}
