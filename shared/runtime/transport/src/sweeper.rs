//! Removal of shared memory that never got a size.
//!
//! A process that is killed between making a file of shared memory and giving it a size leaves one of no bytes.
//! A process that opens it waits for ever: in iceoryx2 0.10 `open_impl` of its POSIX shared memory has no time limit
//! there, and neither has the removal of what the dead left, so that a supervisor stood still for good. Without the
//! file the opening fails, and all go on.

use crate::cleanup::shared_memory_files;
use crate::error::TransportError;
use crate::identity::RunIdentity;
use std::collections::BTreeSet;
use std::os::unix::fs::MetadataExt;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Time between two looks: a living process gives its files a size within microseconds, on a busy machine within
/// far less than this.
const INTERVAL: Duration = Duration::from_secs(2);

/// A thread that looks after a run's shared memory, for a process that waits in an opening cannot look; ends when dropped.
#[derive(Debug)]
pub struct Sweeper {
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Sweeper {
    /// Begins to look after a run's shared memory.
    ///
    /// # Errors
    /// Where no thread can be made.
    pub fn start(identity: &RunIdentity) -> Result<Self, TransportError> {
        Self::every(identity, INTERVAL)
    }

    fn every(identity: &RunIdentity, interval: Duration) -> Result<Self, TransportError> {
        let is_over = Arc::new(AtomicBool::new(false));
        let (identity, is_told) = (identity.clone(), Arc::clone(&is_over));
        let thread = std::thread::Builder::new().name("sweeper".into());
        let thread = thread.spawn(move || {
            let mut known = BTreeSet::new();
            while !is_told.load(Ordering::Acquire) {
                known = sweep(&identity, &known);
                std::thread::park_timeout(interval);
            }
        });
        let thread = thread.map_err(|e| TransportError::Open {
            what: "a thread of the sweeper".into(),
            reason: e.to_string(),
        })?;
        Ok(Self { is_over, thread: Some(thread) })
    }
}

impl Drop for Sweeper {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

/// Removes the files without a size that were there at the look before; those that are new.
fn sweep(identity: &RunIdentity, known: &BTreeSet<(PathBuf, u64)>) -> BTreeSet<(PathBuf, u64)> {
    let mut new = BTreeSet::new();
    for path in shared_memory_files(identity) {
        let Ok(meta) = path.symlink_metadata() else { continue };
        if !meta.is_file() || meta.len() > 0 {
            continue;
        }
        let file = (path, meta.ino());
        if known.contains(&file) {
            let _ = std::fs::remove_file(&file.0);
        } else {
            new.insert(file);
        }
    }
    new
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cleanup::SHARED_MEMORY;
    use crate::registry::RunClaim;
    use std::path::Path;
    use std::time::Instant;

    #[test]
    fn a_file_that_gets_no_size_goes_and_others_stay() {
        let dir = tempfile::tempdir().unwrap();
        let claim = RunClaim::take(&format!("test-sweeper-{}", std::process::id()), dir.path()).unwrap();
        let identity = claim.entry.identity.clone();
        let file = |name: &str| Path::new(SHARED_MEMORY).join(format!("{}{name}", identity.prefix));
        let (unsized_file, sized) = (file("unsized.connection"), file("sized.connection"));
        std::fs::write(&unsized_file, []).unwrap();
        std::fs::write(&sized, [1]).unwrap();
        let new = sweep(&identity, &BTreeSet::new());
        assert!(new.len() == 1 && unsized_file.exists(), "it may be in the making");
        // Another file of that name is new again.
        let other = new.iter().map(|(path, inode)| (path.clone(), inode + 1)).collect();
        assert!(sweep(&identity, &other) == new && unsized_file.exists());
        let sweeper = Sweeper::every(&identity, Duration::from_millis(1)).unwrap();
        let began = Instant::now();
        while unsized_file.exists() {
            assert!(began.elapsed() < Duration::from_secs(60));
            std::thread::sleep(Duration::from_millis(1));
        }
        drop(sweeper);
        assert!(sized.exists());
        std::fs::remove_file(sized).unwrap();
    }
}
