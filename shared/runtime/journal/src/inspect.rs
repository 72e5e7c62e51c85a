//! Reading a journal to its end without a lock and without a change: what of it is whole.

use crate::damage::{BrokenAt, bytes_from, records_behind, walk};
use crate::error::JournalError;
use crate::framing::{FILE_HEADER_BYTES, FileStart, check_file_header, kind_in};
use crate::kind::{RecordKind, UnreadableRecord};
use crate::scan::{Mark, read_at};
use crate::synced::SyncedFile;
use serde::de::DeserializeOwned;
use std::fs::File;
use std::path::Path;
use std::time::Duration;

/// Looks at an end that is not whole before it is called torn: a writer may be at work.
const LOOKS: u32 = 5;
const BETWEEN_LOOKS: Duration = Duration::from_millis(20);

/// How a journal ends.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ending {
    /// With a whole record.
    Whole,
    /// With bytes that were never a whole record: its next writer cuts them.
    Torn {
        /// What is wrong with them.
        reason: String,
    },
    /// Before its end: its next writer refuses it.
    Damaged {
        /// What is wrong there.
        reason: String,
        /// Whole records behind.
        n_lost: u64,
    },
}

/// What a journal holds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inspection {
    /// Whole records, up to the first that is not.
    pub n_records: u64,
    /// Their bytes, those of the header among them.
    pub whole_bytes: u64,
    /// What comes behind them.
    pub ending: Ending,
}

/// Reads every record of a journal of this kind, which may still be written.
///
/// # Errors
/// Where the file cannot be read, is something else, or is of another version.
pub fn inspect<T: DeserializeOwned>(
    path: &Path,
    kind: RecordKind<T>,
    mut accept: impl FnMut(T) -> Result<(), String>,
) -> Result<Inspection, JournalError> {
    inspect_payloads(path, kind.name, &mut |version, payload| {
        accept(kind.decode(version, payload)?).map_err(UnreadableRecord::Damage)
    })
}

/// As [`inspect`], of a file of records whatever they hold.
///
/// # Errors
/// As [`inspect`].
pub fn inspect_framing(path: &Path) -> Result<Inspection, JournalError> {
    let file = File::open(path).map_err(JournalError::io("open", path))?;
    let mut header = Vec::new();
    if !read_at(&file, path, 0, FILE_HEADER_BYTES, &mut header)? {
        header.clear();
    }
    inspect_payloads(path, &kind_in(&header), &mut |_, _| Ok(()))
}

/// Takes version and payload of a record.
type AcceptPayload<'a> = dyn FnMut(u32, &[u8]) -> Result<(), UnreadableRecord> + 'a;

fn inspect_payloads(
    path: &Path,
    kind: &str,
    accept: &mut AcceptPayload<'_>,
) -> Result<Inspection, JournalError> {
    let file = File::open(path).map_err(JournalError::io("open", path))?;
    let mut header = Vec::new();
    if !read_at(&file, path, 0, FILE_HEADER_BYTES, &mut header)? {
        header = bytes_from(&file, path, 0)?;
    }
    if check_file_header(&header, kind, path)? == FileStart::Torn {
        let n_lost = records_behind(&bytes_from(&file, path, 0)?);
        let reason = "the file's first bytes are missing".to_owned();
        let ending = if n_lost > 0 { Ending::Damaged { reason, n_lost } } else { Ending::Torn { reason } };
        return Ok(Inspection { n_records: 0, whole_bytes: 0, ending });
    }
    let mut mark = Mark::start(kind);
    let mut n_looks = 0;
    let broken = loop {
        let before = mark;
        // Read first: what is noted as forced to disk was written before.
        let synced = SyncedFile::beside(path).read();
        let broken = walk(&file, path, &mut mark, synced, &mut *accept)?;
        n_looks = if mark == before { u32::saturating_add(n_looks, 1) } else { 0 };
        match broken {
            Some(_) if n_looks < LOOKS => std::thread::sleep(BETWEEN_LOOKS),
            broken => break broken,
        }
    };
    let ending = match broken {
        None => Ending::Whole,
        Some(broken) if broken.is_torn_end() => Ending::Torn { reason: broken.reason },
        Some(BrokenAt { reason, n_lost, .. }) => Ending::Damaged { reason, n_lost },
    };
    Ok(Inspection { n_records: mark.n_records, whole_bytes: mark.end, ending })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Journal;

    const TEST: RecordKind<u64> = RecordKind::only("test", 7);

    #[test]
    fn whole_torn_and_damaged_are_told_apart() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("j");
        let (mut journal, _) = Journal::open(&path, TEST, Duration::ZERO, |_| Ok(())).unwrap();
        (0..20).for_each(|k| journal.append(&(k * 1000), false).unwrap());
        let mut sum = 0;
        let mut look = || {
            sum = 0;
            inspect(&path, TEST, |k: u64| {
                sum += k;
                Ok(())
            })
            .unwrap()
        };
        // While its writer holds it.
        let whole = look();
        assert_eq!((whole.n_records, &whole.ending), (20, &Ending::Whole));
        assert_eq!(inspect_framing(&path).unwrap(), whole);
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        assert!(matches!(look(), Inspection { n_records: 19, ending: Ending::Torn { .. }, .. }));
        let mut damaged = bytes.clone();
        damaged[200] ^= 1;
        std::fs::write(&path, &damaged).unwrap();
        let found = look();
        assert!(matches!(found.ending, Ending::Damaged { n_lost, .. } if n_lost + found.n_records == 19));
        assert_eq!(std::fs::read(&path).unwrap(), damaged);
        assert_eq!(sum, (0..found.n_records).map(|k| k * 1000).sum::<u64>());
        assert!(inspect(&path, RecordKind::only("other", 7), |_: u64| Ok(())).is_err());
    }
}
