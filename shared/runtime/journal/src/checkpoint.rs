//! A fold over a journal as it was at some record, so that a successor need not read the records
//! before it: one record in a file of its own, replaced as a whole.

use crate::atomic_file::{Durability, write_atomically};
use crate::codec;
use crate::error::JournalError;
use crate::follower::Follower;
use crate::framing::{
    Digest, FILE_HEADER_BYTES, RECORD_HEADER_BYTES, file_header, first_link, seal, sealed_header,
};
use crate::kind::RecordKind;
use crate::raw::Chain;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::io;
use std::path::Path;

/// Replaces the checkpoint and answers its length in bytes. Nothing is forced to disk: a checkpoint
/// that is gone after a power loss is no loss.
///
/// # Errors
/// Where it cannot be written; the one before then stays.
pub fn write_checkpoint<T: Serialize>(
    path: &Path,
    kind: RecordKind<T>,
    state: &T,
) -> Result<u64, JournalError> {
    // Written as it is encoded, twice: the state of a run of days has megabytes, which are not held again as bytes.
    let mut payload = Digest::default();
    codec::encode(state, &mut payload, path)?;
    let header = sealed_header(kind.version, first_link(kind.name), &payload);
    write_atomically(path, Durability::Scratch, |writer| {
        writer.write_all(&file_header(kind.name))?;
        writer.write_all(&header)?;
        codec::encode(state, writer, path).map_err(io::Error::other)
    })
    .map_err(JournalError::io("write", path))?;
    Ok(payload.len.saturating_add((FILE_HEADER_BYTES + RECORD_HEADER_BYTES) as u64))
}

/// The bytes of a file with one record; errors name it as `path`.
///
/// # Errors
/// Where it is too large to be a record.
pub fn sealed_record<T: Serialize>(
    path: &Path,
    kind: RecordKind<T>,
    record: &T,
) -> Result<Vec<u8>, JournalError> {
    let mut bytes = vec![0; RECORD_HEADER_BYTES];
    codec::encode(record, &mut bytes, path)?;
    seal(&mut bytes, kind.version, first_link(kind.name));
    bytes.splice(0..0, file_header(kind.name));
    Ok(bytes)
}

/// The record in the bytes of [`sealed_record`].
///
/// # Errors
/// Where they are something else, of another version, cut, damaged, or more than that.
pub fn unsealed_record<T: DeserializeOwned>(kind: RecordKind<T>, bytes: &[u8]) -> Result<T, String> {
    let (mut chain, path) = (Chain::new(kind.name), Path::new("a record"));
    let mut next = |from: usize| {
        chain.step(bytes.get(from..).unwrap_or_default(), path).map_err(|error| error.to_string())
    };
    let cut = || format!("a record that is cut, of {} bytes", bytes.len());
    let header = next(0)?.ok_or_else(cut)?.len;
    let record = next(header)?.ok_or_else(cut)?;
    let n_behind = bytes.len().saturating_sub(header).saturating_sub(record.len);
    match record.payload {
        Some(payload) if n_behind == 0 => kind.read(record.version, payload),
        _ => Err(format!("{n_behind} bytes behind a record")),
    }
}

/// The checkpoint; `None` where there is none or it is not whole.
///
/// # Errors
/// Where the file is something else or was written by another version.
pub fn read_checkpoint<T: DeserializeOwned>(
    path: &Path,
    kind: RecordKind<T>,
) -> Result<Option<T>, JournalError> {
    if !path.exists() {
        return Ok(None);
    }
    Follower::open(path, kind)?.next()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Journal, Mark, Opening};
    use std::time::Duration;

    type State = (u64, String);

    const TEST: RecordKind<State> = RecordKind::only("test", 7);
    const NUMBERS: RecordKind<u64> = RecordKind::only("test", 7);

    #[test]
    fn a_checkpoint_is_whole_or_absent() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.checkpoint");
        let read = || read_checkpoint(&path, TEST);
        assert_eq!(read().unwrap(), None);
        for n in [3, 4] {
            let state = (n, "x".repeat(500));
            let len = write_checkpoint(&path, TEST, &state).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            assert_eq!(bytes.len() as u64, len);
            assert_eq!(bytes, sealed_record(&path, TEST, &state).unwrap());
            assert_eq!(read().unwrap(), Some(state));
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "nothing else is left");
        let whole = std::fs::read(&path).unwrap();
        for cut in 0..whole.len() {
            std::fs::write(&path, &whole[..cut]).unwrap();
            assert_eq!(read().unwrap(), None, "cut at {cut}");
        }
        let mut flipped = whole.clone();
        flipped[100] ^= 4;
        std::fs::write(&path, flipped).unwrap();
        assert_eq!(read().unwrap(), None);
        std::fs::write(&path, "ply\nformat ascii 1.0\nelement vertex 3").unwrap();
        assert!(read().unwrap_err().to_string().contains("ply"));
    }

    #[test]
    fn the_bytes_of_one_record_are_believed_whole_and_of_their_kind_alone() {
        let record = (7u64, "x".repeat(50));
        let bytes = sealed_record(Path::new("a"), TEST, &record).unwrap();
        let read = |name, bytes: &[u8]| unsealed_record::<State>(RecordKind::only(name, 7), bytes);
        assert_eq!(read("test", &bytes), Ok(record));
        assert!(read("other", &bytes).is_err());
        (0..bytes.len()).for_each(|cut| assert!(read("test", &bytes[..cut]).is_err(), "cut at {cut}"));
        for at in 0..bytes.len() {
            let mut flipped = bytes.clone();
            flipped[at] ^= 4;
            assert!(read("test", &flipped).is_err(), "byte {at}");
        }
        let longer = [&bytes[..], &[0]].concat();
        assert_eq!(read("test", &longer), Err("1 bytes behind a record".to_owned()));
    }

    /// A journal of `n` records and the mark behind each, the first one before all.
    fn journal(path: &Path, n: u64) -> Vec<Mark> {
        let (mut journal, _) = Journal::open(path, NUMBERS, Duration::ZERO, |_| Ok(())).unwrap();
        let mut marks = vec![journal.mark()];
        for k in 0..n {
            journal.append(&(k * k * 1000), false).unwrap();
            marks.push(journal.mark());
        }
        marks
    }

    #[test]
    fn a_journal_goes_on_from_a_mark() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        let marks = journal(&path, 20);
        for (k, mark) in marks.iter().enumerate() {
            assert!(mark.fits(&path, "test").unwrap());
            assert!(!mark.fits(&path, "other").unwrap());
            let mut records = Vec::new();
            let opening = Opening { mark: Some(mark), ..Opening::new(Duration::ZERO) };
            let (opened, recovered) = Journal::open_as(&path, NUMBERS, opening, |record| {
                records.push(record);
                Ok(())
            })
            .unwrap();
            assert_eq!(records, (k as u64..20).map(|k| k * k * 1000).collect::<Vec<_>>());
            assert_eq!((opened.mark(), recovered.n_records), (marks[20], 20));
            let mut follower = Follower::open_behind(&path, NUMBERS, Some(mark)).unwrap();
            assert_eq!(follower.next().unwrap(), records.first().copied());
        }
    }

    #[test]
    fn a_forged_mark_fits_nothing_and_overflows_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        journal(&path, 3);
        for forged in [
            Mark::forged(u64::MAX, u64::MAX, u64::MAX),
            Mark::forged(u64::MAX, 0, 7),
            Mark::forged(1, u64::MAX - 3, u64::MAX),
        ] {
            assert!(!forged.fits(&path, "test").unwrap());
        }
    }

    #[test]
    fn a_mark_does_not_fit_another_past() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        let marks = journal(&path, 20);
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[..whole.len() - 1]).unwrap();
        assert!(!marks[20].fits(&path, "test").unwrap(), "its last record is torn");
        assert!(marks[19].fits(&path, "test").unwrap());
        // The same lengths, another record far before: the chain tells.
        std::fs::remove_file(&path).unwrap();
        let (mut other, _) = Journal::open(&path, NUMBERS, Duration::ZERO, |_| Ok(())).unwrap();
        for k in 0..20u64 {
            other.append(&(if k == 2 { 4001 } else { k * k * 1000 }), false).unwrap();
        }
        assert_eq!(std::fs::metadata(&path).unwrap().len(), whole.len() as u64);
        assert!(marks[2].fits(&path, "test").unwrap());
        assert!(!marks[3].fits(&path, "test").unwrap());
        assert!(!marks[20].fits(&path, "test").unwrap());
    }
}
