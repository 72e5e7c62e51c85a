//! The writing end of a journal.

use crate::codec;
use crate::damage::{BrokenAt, OnDamage, bytes_from, records_behind, set_aside, walk};
use crate::error::{JournalError, sync_file};
use crate::framing::{
    FILE_HEADER_BYTES, FileStart, RECORD_HEADER_BYTES, RecordHead, check_file_header, file_header, seal,
};
use crate::kind::{RecordKind, UnreadableRecord};
use crate::lock::lock_file;
use crate::scan::{Mark, read_at};
use crate::synced::SyncedFile;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What opening a journal found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recovered {
    /// Whole records, those before a mark included.
    pub n_records: u64,
    /// Bytes behind the last whole record; they are gone now.
    pub dropped_bytes: u64,
    /// Why the first of them was not a record.
    pub reason: Option<String>,
    /// The file as it was, where more than a torn end was dropped.
    pub set_aside: Option<PathBuf>,
}

/// How a journal is opened.
#[derive(Clone, Copy, Debug)]
pub struct Opening<'m> {
    /// A place to go on from, if it fits ([`Mark::fits`]): only records behind it are handed over.
    pub mark: Option<&'m Mark>,
    /// How long another writer may take to end.
    pub wait: Duration,
    /// Treatment of damage before the end.
    pub on_damage: OnDamage,
    /// Whether the journal was begun before: one that is absent or empty is then damaged.
    pub is_begun: bool,
}

impl Opening<'_> {
    /// A journal that may be new; damage is refused.
    pub fn new(wait: Duration) -> Self {
        Self { mark: None, wait, on_damage: OnDamage::Refuse, is_begun: false }
    }
}

/// An append-only file of records that this process alone writes.
#[derive(Debug)]
pub struct Journal<T> {
    file: File,
    path: PathBuf,
    mark: Mark,
    synced: SyncedFile,
    buffer: Vec<u8>,
    kind: RecordKind<T>,
}

impl<T: Serialize + DeserializeOwned> Journal<T> {
    /// Opens or creates the journal, locks it, and hands every whole record to `accept` in order.
    /// A torn end is cut; damage before the end is refused.
    ///
    /// # Errors
    /// As [`Self::open_as`].
    pub fn open(
        path: &Path,
        kind: RecordKind<T>,
        wait: Duration,
        accept: impl FnMut(T) -> Result<(), String>,
    ) -> Result<(Self, Recovered), JournalError> {
        Self::open_as(path, kind, Opening::new(wait), accept)
    }

    /// As [`Self::open`], as `opening` states.
    ///
    /// A record that `accept` refuses is damage: it names something that is not there (any more).
    /// Bytes at the end with no whole record behind them are a torn end, cut and reported; so is all
    /// that was never forced to disk, where the machine was started again since. In any other case
    /// [`OnDamage`] decides.
    ///
    /// # Errors
    /// [`JournalError::Damaged`]; or the file is locked by another writer for longer than `wait`, is
    /// something else, is of another version, or cannot be read.
    pub fn open_as(
        path: &Path,
        kind: RecordKind<T>,
        opening: Opening<'_>,
        mut accept: impl FnMut(T) -> Result<(), String>,
    ) -> Result<(Self, Recovered), JournalError> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(!opening.is_begun || opening.on_damage == OnDamage::SetAside)
            .truncate(false)
            .mode(0o600)
            .open(path)
            .map_err(|error| match error.kind() {
                std::io::ErrorKind::NotFound if opening.is_begun => {
                    JournalError::Absent { path: path.into() }
                }
                _ => JournalError::io("open", path)(error),
            })?;
        lock_file(&file, path, opening.wait)?;
        let synced = SyncedFile::beside(path);
        let mut journal = Self {
            file,
            path: path.into(),
            mark: opening.mark.copied().unwrap_or(Mark::start(kind.name)),
            synced,
            buffer: Vec::new(),
            kind,
        };
        let mut recovered = Recovered::default();
        if !journal.read_start(kind.name, &opening, &mut recovered)? {
            return Ok((journal, recovered));
        }
        if let Some(broken) = journal.read_records(&mut accept)? {
            let len = journal.len()?;
            recovered.dropped_bytes = len.saturating_sub(journal.mark.end);
            if !broken.is_torn_end() {
                if opening.on_damage == OnDamage::Refuse && !broken.is_unsynced {
                    return Err(journal.damaged(journal.mark.end, broken));
                }
                recovered.set_aside = Some(set_aside(path)?);
            }
            recovered.reason = Some(broken.reason);
            journal.file.set_len(journal.mark.end).map_err(JournalError::io("cut", path))?;
        }
        journal.write_unsynced_again()?;
        recovered.n_records = journal.mark.n_records;
        Ok((journal, recovered))
    }

    /// Checks the header; writes one where there is none. `false`: there are no records.
    fn read_start(
        &mut self,
        kind: &str,
        opening: &Opening<'_>,
        recovered: &mut Recovered,
    ) -> Result<bool, JournalError> {
        let (file, path) = (&self.file, &self.path);
        let len = self.len()?;
        let mut buffer = Vec::new();
        if !read_at(file, path, 0, FILE_HEADER_BYTES, &mut buffer)? {
            buffer.truncate(usize::try_from(len).unwrap_or(usize::MAX));
        }
        let is_set_aside = opening.on_damage == OnDamage::SetAside;
        let reason = match check_file_header(&buffer, kind, path) {
            Ok(FileStart::Whole) => return Ok(true),
            Ok(FileStart::Torn) if len == 0 => "the file is empty".to_owned(),
            Ok(FileStart::Torn) => "the file's first bytes are missing".to_owned(),
            Err(error @ JournalError::Foreign { .. }) if is_set_aside => error.to_string(),
            Err(error) => return Err(error),
        };
        self.mark = Mark::start(kind);
        let n_lost = if len == 0 { 0 } else { records_behind(&bytes_from(file, path, 0)?) };
        if opening.is_begun || n_lost > 0 {
            if !is_set_aside {
                let synced_lost = self.synced.read().map_or(0, |synced| synced.len);
                let broken = BrokenAt { reason, n_lost, synced_lost, is_unsynced: false };
                return Err(self.damaged(0, broken));
            }
            recovered.set_aside = if len > 0 { Some(set_aside(path)?) } else { None };
        }
        recovered.dropped_bytes = len;
        recovered.reason = (len > 0 || opening.is_begun).then_some(reason);
        self.file.set_len(0).map_err(JournalError::io("cut", path))?;
        self.file.write_all_at(&file_header(kind), 0).map_err(JournalError::io("write", path))?;
        Ok(false)
    }

    /// Hands over records up to the end or to the first that cannot be used.
    fn read_records(
        &mut self,
        accept: &mut impl FnMut(T) -> Result<(), String>,
    ) -> Result<Option<BrokenAt>, JournalError> {
        let synced = self.synced.read();
        let kind = self.kind;
        let accept = |version: u32, payload: &[u8]| {
            accept(kind.decode(version, payload)?).map_err(UnreadableRecord::Damage)
        };
        walk(&self.file, &self.path, &mut self.mark, synced, accept)
    }

    fn damaged(&self, offset: u64, broken: BrokenAt) -> JournalError {
        let BrokenAt { reason, n_lost, synced_lost, .. } = broken;
        let (path, n_before) = (self.path.clone(), self.mark.n_records);
        JournalError::Damaged { path, offset, reason, n_before, n_lost, synced_lost }
    }

    fn len(&self) -> Result<u64, JournalError> {
        Ok(self.file.metadata().map_err(JournalError::io("look at", &self.path))?.len())
    }

    /// Writes what may not have reached the disk once more, so that the next sync covers it: after a
    /// sync that failed, the system holds such pages as if they were on disk.
    fn write_unsynced_again(&mut self) -> Result<(), JournalError> {
        let Some(synced) = self.synced.read().filter(|synced| synced.len < self.mark.end) else {
            return Ok(());
        };
        let bytes = bytes_from(&self.file, &self.path, synced.len)?;
        self.file.write_all_at(&bytes, synced.len).map_err(JournalError::io("write", &self.path))
    }

    /// Appends a record; with `sync` it has reached the disk when this returns.
    ///
    /// # Errors
    /// A full disk leaves the journal as it was. [`JournalError::NotSynced`]: the record is journaled,
    /// and a power cut may take it and others before it.
    pub fn append(&mut self, record: &T, sync: bool) -> Result<(), JournalError> {
        self.buffer.clear();
        self.buffer.resize(RECORD_HEADER_BYTES, 0);
        codec::encode(record, &mut self.buffer, &self.path)?;
        let crc = seal(&mut self.buffer, self.kind.version, self.mark.link);
        let written = self.file.write_all_at(&self.buffer, self.mark.end);
        if written.is_err() {
            // Half a record may stand there; the next one overwrites it if this fails too.
            let _ = self.file.set_len(self.mark.end);
        }
        written.map_err(JournalError::io("append to", &self.path))?;
        let len = self.buffer.len().saturating_sub(RECORD_HEADER_BYTES);
        self.mark = self.mark.behind(&RecordHead { len, version: self.kind.version, crc });
        if sync { self.sync() } else { Ok(()) }
    }

    /// Forces every record to disk.
    ///
    /// # Errors
    /// [`JournalError::NotSynced`].
    pub fn sync(&mut self) -> Result<(), JournalError> {
        sync_file(&self.file, &self.path)?;
        self.synced.note(self.mark.end);
        Ok(())
    }

    /// Forces every record to disk without a note beside the file: for a journal that is not one of a run
    /// that syncs.
    ///
    /// # Errors
    /// [`JournalError::NotSynced`].
    pub fn sync_unnoted(&self) -> Result<(), JournalError> {
        sync_file(&self.file, &self.path)
    }

    /// Behind the last record.
    pub fn mark(&self) -> Mark {
        self.mark
    }
}

#[cfg(test)]
mod tests;
