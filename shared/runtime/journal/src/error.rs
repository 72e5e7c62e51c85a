//! Errors of the files of a run directory.

use std::path::{Path, PathBuf};

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
        /// Version of this program.
        expected: u32,
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

fn holder_text(holder: &Option<u32>) -> String {
    holder.map_or_else(String::new, |pid| format!(" (pid {pid})"))
}

impl JournalError {
    pub(crate) fn io(action: &'static str, path: &Path) -> impl FnOnce(std::io::Error) -> JournalError {
        move |source| JournalError::Io { action, path: path.into(), source }
    }
}
