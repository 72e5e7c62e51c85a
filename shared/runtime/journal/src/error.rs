//! Errors of the files of a run directory.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// A journal or store that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum JournalError {
    /// The operating system refused.
    #[error("cannot {action} {path}: {source}")]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// Another process writes this file.
    #[error("{path} is being written by another process{}", holder_text(.holder))]
    Locked {
        /// The file.
        path: PathBuf,
        /// Process id of the holder, where the kernel tells.
        holder: Option<u32>,
    },
    /// Another process may write this file, and that cannot be proven.
    #[error(
        "{path} is locked, it seems by a process that cannot be proven to hold it (pid {pid}): it is left \
         alone; end it if it is a stage of this run, then try again"
    )]
    Unproven {
        /// The file.
        path: PathBuf,
        /// The process.
        pid: u32,
    },
    /// The file is something else.
    #[error("{path} is not a Tessera {expected}: it begins with {found}")]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it should be.
        expected: String,
        /// Its first bytes.
        found: String,
    },
    /// The file was written by another version.
    #[error("{path} has format version {found}, this program reads version {expected}")]
    Version {
        /// The file.
        path: PathBuf,
        /// Version in the file.
        found: u32,
        /// Versions that this program reads.
        expected: String,
    },
    /// A file that belongs to the run is not there.
    #[error("{path} is not there, and the run has records in it")]
    Absent {
        /// The file.
        path: PathBuf,
    },
    /// Damage before the end of a journal; nothing was changed.
    #[error("{path} is damaged at byte {offset}, behind {n_before} whole records: {reason}; {}", lost_text(*.n_lost, *.synced_lost))]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where the first record that cannot be used begins.
        offset: u64,
        /// Why it cannot.
        reason: String,
        /// Whole records before it.
        n_before: u64,
        /// Whole records from there on.
        n_lost: u64,
        /// Bytes that were forced to disk and are not there.
        synced_lost: u64,
    },
    /// The disk did not take what was written.
    #[error("{path} was not forced to disk: {source}; a power cut may take what was written last")]
    NotSynced {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// A record cannot be written as bytes.
    #[error("cannot encode a record for {path}: {reason}")]
    Encode {
        /// The file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// A slot of the store does not hold what its record says.
    #[error("{path}: the {len} bytes at offset {offset} {problem}")]
    Slot {
        /// The file.
        path: PathBuf,
        /// Byte offset.
        offset: u64,
        /// Length in bytes.
        len: u64,
        /// What is wrong.
        problem: String,
    },
}

fn lost_text(n_lost: u64, synced_lost: u64) -> String {
    match (n_lost, synced_lost) {
        (0, 0) => "the run has records that are not there".into(),
        (0, bytes) => format!("{bytes} bytes that were on disk are not there any more"),
        (1, _) => "1 whole record from there on would be lost".into(),
        (n, _) => format!("{n} whole records from there on would be lost"),
    }
}

/// Whether the disk takes nothing more, for tests of what comes of that.
static SYNCS_FAIL: AtomicBool = AtomicBool::new(false);

/// From here on no sync of this process succeeds, as on a disk with an input/output error: a fault for tests.
pub fn let_syncs_fail() {
    SYNCS_FAIL.store(true, Ordering::Relaxed);
}

/// Forces a file's bytes to disk.
pub(crate) fn sync_file(file: &std::fs::File, path: &Path) -> Result<(), JournalError> {
    let synced = match SYNCS_FAIL.load(Ordering::Relaxed) {
        true => Err(rustix::io::Errno::IO.into()),
        false => file.sync_data(),
    };
    synced.map_err(|source| JournalError::NotSynced { path: path.into(), source })
}

fn holder_text(holder: &Option<u32>) -> String {
    holder.map_or_else(String::new, |pid| format!(" (pid {pid})"))
}

impl JournalError {
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> JournalError {
        move |source| JournalError::Io { action, path: path.into(), source }
    }
}
