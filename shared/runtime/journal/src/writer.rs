//! The writing end of a journal.

use crate::codec;
use crate::error::JournalError;
use crate::framing::{
    FILE_HEADER_BYTES, FileStart, RECORD_HEADER_BYTES, check_file_header, file_header, seal,
};
use crate::lock::lock_file;
use crate::scan::{Mark, NoRecord, next_record, read_at};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::{File, OpenOptions};
use std::marker::PhantomData;
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
}

/// An append-only file of records that this process alone writes.
#[derive(Debug)]
pub struct Journal<T> {
    file: File,
    path: PathBuf,
    mark: Mark,
    buffer: Vec<u8>,
    of: PhantomData<fn(T)>,
}

impl<T: Serialize + DeserializeOwned> Journal<T> {
    /// Opens or creates the journal, locks it, and hands every whole record to `accept` in order.
    ///
    /// A record that `accept` refuses ends the journal before it, as a torn one does: it names
    /// something that is not there (any more). What lies behind is cut off and reported.
    ///
    /// # Errors
    /// Where the file is locked by another writer for longer than `wait`, is something else, is
    /// of another version, or cannot be read.
    pub fn open(
        path: &Path,
        kind: &str,
        wait: Duration,
        accept: impl FnMut(T) -> Result<(), String>,
    ) -> Result<(Self, Recovered), JournalError> {
        Self::open_behind(path, kind, None, wait, accept)
    }

    /// As [`Self::open`], but only records behind a mark that fits ([`Mark::fits`]) are handed over.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_behind(
        path: &Path,
        kind: &str,
        mark: Option<&Mark>,
        wait: Duration,
        mut accept: impl FnMut(T) -> Result<(), String>,
    ) -> Result<(Self, Recovered), JournalError> {
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .open(path)
            .map_err(JournalError::io("open", path))?;
        lock_file(&file, path, wait)?;
        let mut recovered = Recovered::default();
        let mut mark = mark.copied().unwrap_or(Mark::start(kind));
        let mut buffer = Vec::new();
        if !read_at(&file, path, 0, FILE_HEADER_BYTES, &mut buffer)? {
            let len = file.metadata().map_err(JournalError::io("look at", path))?.len();
            buffer.truncate(len as usize);
        }
        if check_file_header(&buffer, kind, path)? == FileStart::Torn {
            let len = file.metadata().map_err(JournalError::io("look at", path))?.len();
            mark = Mark::start(kind);
            recovered.dropped_bytes = len;
            recovered.reason = (len > 0).then(|| "the file's first bytes are missing".into());
            file.set_len(0).map_err(JournalError::io("cut", path))?;
            file.write_all_at(&file_header(kind), 0).map_err(JournalError::io("write", path))?;
        }
        loop {
            let found = next_record(&file, path, &mark, &mut buffer)?.and_then(|crc| {
                codec::decode(&buffer).and_then(&mut accept).map_err(NoRecord::Broken)?;
                Ok(crc)
            });
            match found {
                Ok(crc) => mark = mark.behind(buffer.len(), crc),
                Err(NoRecord::End) => break,
                Err(NoRecord::Broken(reason)) => {
                    let len = file.metadata().map_err(JournalError::io("look at", path))?.len();
                    recovered.dropped_bytes = len.saturating_sub(mark.end);
                    recovered.reason = Some(reason);
                    file.set_len(mark.end).map_err(JournalError::io("cut", path))?;
                    break;
                }
            }
        }
        recovered.n_records = mark.n_records;
        Ok((Self { file, path: path.into(), mark, buffer: Vec::new(), of: PhantomData }, recovered))
    }

    /// Appends a record; with `sync` it has reached the disk when this returns.
    ///
    /// # Errors
    /// A full disk leaves the journal as it was.
    pub fn append(&mut self, record: &T, sync: bool) -> Result<(), JournalError> {
        self.buffer.clear();
        self.buffer.resize(RECORD_HEADER_BYTES, 0);
        codec::encode(record, &mut self.buffer, &self.path)?;
        let crc = seal(&mut self.buffer, self.mark.link);
        let written = self.file.write_all_at(&self.buffer, self.mark.end);
        if written.is_err() {
            // Half a record may stand there; the next one overwrites it if this fails too.
            let _ = self.file.set_len(self.mark.end);
        }
        written.map_err(JournalError::io("append to", &self.path))?;
        if sync {
            self.file.sync_data().map_err(JournalError::io("sync", &self.path))?;
        }
        self.mark = self.mark.behind(self.buffer.len() - RECORD_HEADER_BYTES, crc);
        Ok(())
    }

    /// Behind the last record.
    pub fn mark(&self) -> Mark {
        self.mark
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Follower;

    type Record = (u64, Vec<f64>, String);

    fn record(n: u64) -> Record {
        (n, (0..n % 7).map(|k| k as f64 * 0.1).collect(), "word ".repeat((n % 90) as usize))
    }

    fn written(path: &Path, n: u64) {
        let (mut journal, _) = Journal::<Record>::open(path, "test", Duration::ZERO, |_| Ok(())).unwrap();
        for k in 0..n {
            journal.append(&record(k), false).unwrap();
        }
    }

    fn read(path: &Path) -> (Vec<Record>, Recovered) {
        let mut records = Vec::new();
        let (_, recovered) = Journal::<Record>::open(path, "test", Duration::ZERO, |r| {
            records.push(r);
            Ok(())
        })
        .unwrap();
        (records, recovered)
    }

    #[test]
    fn a_file_cut_anywhere_gives_a_prefix_and_goes_on() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        written(&path, 40);
        let whole = std::fs::read(&path).unwrap();
        let mut seen = 0;
        for cut in 0..=whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            let (records, recovered) = read(&path);
            assert!(records.iter().enumerate().all(|(k, r)| *r == record(k as u64)), "cut at {cut}");
            assert!(records.len() >= seen);
            seen = records.len();
            let kept = std::fs::metadata(&path).unwrap().len();
            if cut >= FILE_HEADER_BYTES {
                assert_eq!(kept + recovered.dropped_bytes, cut as u64);
            }
        }
        assert_eq!(seen, 40);
    }

    #[test]
    fn zeroed_pages_end_the_prefix_and_nothing_stale_comes_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        written(&path, 200);
        let whole = std::fs::read(&path).unwrap();
        assert!(whole.len() > 5 * 4096);
        for page in 0..whole.len() / 4096 {
            let mut bytes = whole.clone();
            bytes[page * 4096..(page + 1) * 4096].fill(0);
            std::fs::write(&path, &bytes).unwrap();
            let (records, recovered) = read(&path);
            assert!(recovered.reason.is_some() && records.len() < 200);
            assert!(records.iter().enumerate().all(|(k, r)| *r == record(k as u64)));
            // Written again from there, the file has the same bytes as if nothing had happened.
            let (mut journal, _) =
                Journal::<Record>::open(&path, "test", Duration::ZERO, |_| Ok(())).unwrap();
            for k in records.len() as u64..200 {
                journal.append(&record(k), false).unwrap();
            }
            drop(journal);
            assert_eq!(std::fs::read(&path).unwrap(), whole);
        }
    }

    #[test]
    fn a_refused_record_ends_the_journal_before_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        written(&path, 9);
        let refuse = |r: Record| if r.0 < 5 { Ok(()) } else { Err("its keyframe is gone".to_string()) };
        let (_, recovered) = Journal::open(&path, "test", Duration::ZERO, refuse).unwrap();
        assert_eq!((recovered.n_records, recovered.reason.as_deref()), (5, Some("its keyframe is gone")));
        assert_eq!(read(&path).0.len(), 5);
    }

    #[test]
    fn there_is_one_writer() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        let (held, _) = Journal::<Record>::open(&path, "test", Duration::ZERO, |_| Ok(())).unwrap();
        let second = Journal::<Record>::open(&path, "test", Duration::ZERO, |_| Ok(()));
        let message = second.unwrap_err().to_string();
        assert!(message.contains("written by another process"), "{message}");
        drop(held);
        Journal::<Record>::open(&path, "test", Duration::ZERO, |_| Ok(())).unwrap();
    }

    #[test]
    fn a_follower_sees_each_record_once_it_is_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        let (mut journal, _) = Journal::<Record>::open(&path, "test", Duration::ZERO, |_| Ok(())).unwrap();
        let mut follower = Follower::<Record>::open(&path, "test").unwrap();
        assert_eq!(follower.next().unwrap(), None);
        for k in 0..30 {
            journal.append(&record(k), false).unwrap();
            assert_eq!(follower.next().unwrap(), Some(record(k)));
            assert_eq!(follower.next().unwrap(), None);
        }
        let whole = std::fs::read(&path).unwrap();
        journal.append(&record(30), false).unwrap();
        let longer = std::fs::read(&path).unwrap();
        // A record that arrives byte by byte is not seen before its last byte.
        for cut in whole.len()..longer.len() {
            std::fs::write(&path, &longer[..cut]).unwrap();
            assert_eq!(follower.next().unwrap(), None);
        }
        std::fs::write(&path, &longer).unwrap();
        assert_eq!(follower.next().unwrap(), Some(record(30)));
    }
}
