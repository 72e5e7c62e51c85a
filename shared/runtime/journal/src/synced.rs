//! The extent of a journal that was forced to disk, in a small file beside it.
//!
//! Records behind that extent survive the death of any process, and a power cut may take them in any
//! order. The file names the boot of the machine too: in the same boot nothing was lost to a power cut,
//! and a gap is damage wherever it lies.

use crate::atomic_file::sync_folder_of;
use std::fs::{File, OpenOptions};
use std::os::unix::fs::{FileExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Length of the file: a number of 20 digits, a blank, a boot of 36 letters, and the end of the line.
const LEN: usize = 58;

/// An extent of a journal on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Synced {
    /// Bytes from the beginning of the journal.
    pub(crate) len: u64,
    /// Written in the boot that goes on.
    pub(crate) is_of_this_boot: bool,
}

/// The writer of that file.
#[derive(Debug)]
pub(crate) struct SyncedFile {
    path: PathBuf,
    file: Option<File>,
    boot: String,
}

impl SyncedFile {
    pub(crate) fn beside(journal: &Path) -> Self {
        let boot = std::fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
        Self { path: journal.with_extension("synced"), file: None, boot: boot.trim().into() }
    }

    /// What the file states; `None` where there is none or it is torn.
    pub(crate) fn read(&self) -> Option<Synced> {
        let text = std::fs::read_to_string(&self.path).ok()?;
        let (len, boot) = text.strip_suffix('\n')?.split_once(' ')?;
        let is_of_this_boot = !self.boot.is_empty() && boot == self.boot;
        Some(Synced { len: len.parse().ok()?, is_of_this_boot })
    }

    /// Notes that the first `len` bytes of the journal are on disk. Only the first note is forced to disk
    /// itself: without any, what a power cut took would pass for damage, and an older one states less, which is
    /// true too. A note that cannot be written leaves the older one.
    pub(crate) fn note(&mut self, len: u64) {
        let is_first = self.file.is_none() && !self.path.exists();
        if self.file.is_none() {
            let opened =
                OpenOptions::new().write(true).create(true).truncate(false).mode(0o600).open(&self.path);
            self.file = opened.ok();
        }
        let Some(file) = &self.file else { return };
        let boot = if self.boot.is_empty() { "unknown" } else { &self.boot };
        let text = format!("{len:020} {boot:<36}\n");
        let _ = file.write_all_at(text.as_bytes(), 0);
        let _ = file.set_len(LEN as u64);
        if is_first {
            let _ = file.sync_data().and_then(|()| sync_folder_of(&self.path));
        }
    }
}
