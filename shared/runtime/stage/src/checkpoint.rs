//! A stage's state as it was some records ago: its successor reads that and what came after.
//!
//! Nothing rests on it. The state is the fold over the journal; a checkpoint that is missing, torn,
//! of another version or of another boot of the machine (after a power loss the journal may have
//! lost pages that were never forced to disk) costs its reader time and nothing else.

use crate::ALIGN_JOURNAL;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tessera_journal::{RecordKind, partial_path, read_checkpoint, write_checkpoint};

/// Layout of the states of this version of records, to be counted up with each change of a field.
const STATE_LAYOUT: u32 = 1;
/// Layouts between two versions of records.
const STATES_PER_VERSION: u32 = 10;

/// What stands in the file.
#[derive(Serialize, Deserialize)]
struct Kept<T> {
    boot: String,
    state: T,
}

/// The checkpoint of one stage.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    kind: &'static str,
    /// Bytes of journal between two; 0: there are none.
    every_bytes: u64,
    /// Which boot of the machine this is; without an answer there are no checkpoints.
    boot: Option<String>,
    /// Bytes of journal before the last one, and its own.
    last_at_bytes: u64,
    last_len_bytes: u64,
    has_failed: bool,
}

impl Checkpoint {
    /// The checkpoint at `path`, renewed whenever journals have grown by `every_kb` and by as much
    /// as the last one took: writing them costs at most as much as the journals do.
    pub fn new(path: &Path, kind: &'static str, every_kb: u32) -> Self {
        Self {
            path: path.into(),
            kind,
            every_bytes: u64::from(every_kb) << 10,
            boot: std::fs::read_to_string("/proc/sys/kernel/random/boot_id").ok(),
            last_at_bytes: 0,
            last_len_bytes: 0,
            has_failed: false,
        }
    }

    /// The state that was kept last in this boot of the machine, if it is there and whole.
    pub fn read<T: DeserializeOwned>(&self) -> Option<T> {
        let boot = self.boot.as_ref().filter(|_| self.every_bytes > 0)?;
        match read_checkpoint::<Kept<T>>(&self.path, self.records()) {
            Ok(kept) => kept.filter(|kept| kept.boot == *boot).map(|kept| kept.state),
            Err(error) => {
                tracing::warn!("{error}; the journal is read from the beginning");
                None
            }
        }
    }

    /// Says where in the journals the state that was read, or begun with, stands.
    pub fn stands_at(&mut self, journal_bytes: u64) {
        self.last_at_bytes = journal_bytes;
        self.last_len_bytes = std::fs::metadata(&self.path).map_or(0, |meta| meta.len());
    }

    /// Whether it is time for a new one, with so many bytes of journal.
    pub fn is_due(&self, journal_bytes: u64) -> bool {
        let grown = journal_bytes.saturating_sub(self.last_at_bytes);
        self.every_bytes > 0 && self.boot.is_some() && grown >= self.every_bytes.max(self.last_len_bytes)
    }

    /// Keeps a state that comes from so many bytes of journal. A failure is said once: the run
    /// needs no checkpoint.
    pub fn write<T: Serialize>(&mut self, state: &T, journal_bytes: u64) {
        let Some(boot) = self.boot.clone() else { return };
        self.last_at_bytes = journal_bytes;
        match write_checkpoint(&self.path, self.records(), &Kept { boot, state }) {
            Ok(len) => self.last_len_bytes = len,
            Err(error) if !self.has_failed => {
                tracing::warn!("{error}; a restart will take longer");
                self.has_failed = true;
            }
            Err(_) => {}
        }
    }

    /// A state is a fold over records of the aligner: another version of them, another state.
    fn records<T>(&self) -> RecordKind<T> {
        RecordKind::only(self.kind, ALIGN_JOURNAL.version * STATES_PER_VERSION + STATE_LAYOUT)
    }

    /// Removes it, and what a killed writer left of one.
    pub fn remove(path: &Path) {
        let _ = std::fs::remove_file(path);
        let _ = std::fs::remove_file(partial_path(path));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn checkpoints_come_as_often_as_journals_grow_by_their_length() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("align.checkpoint");
        let mut checkpoint = Checkpoint::new(&path, "align", 1);
        assert_eq!(checkpoint.read::<Vec<u8>>(), None);
        assert!(!checkpoint.is_due(1000));
        assert!(checkpoint.is_due(1024));
        checkpoint.write(&vec![7u8; 5000], 2000);
        assert!(!checkpoint.is_due(2000 + 4999), "it has more than 5,000 bytes itself");
        assert!(checkpoint.is_due(2000 + 5200));
        assert_eq!(Checkpoint::new(&path, "align", 1).read(), Some(vec![7u8; 5000]));
        assert_eq!(Checkpoint::new(&path, "align", 0).read::<Vec<u8>>(), None, "switched off");
        assert_eq!(Checkpoint::new(&path, "optimise", 1).read::<Vec<u8>>(), None, "of another stage");
        let of_another_boot = Checkpoint { boot: Some("yesterday".into()), ..checkpoint };
        assert_eq!(of_another_boot.read::<Vec<u8>>(), None);
        Checkpoint::remove(&path);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
