//! One writer at a time: an flock that the kernel frees when its holder dies.

use crate::error::JournalError;
use rustix::fs::{FlockOperation, flock};
use std::fs::File;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::{Duration, Instant};

/// Takes the exclusive lock on an open file, waiting up to `wait` for its holder to end.
///
/// # Errors
/// [`JournalError::Locked`] with the holder's pid when the time is over.
pub fn lock_file(file: &File, path: &Path, wait: Duration) -> Result<(), JournalError> {
    let deadline = Instant::now() + wait;
    loop {
        match flock(file, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => return Ok(()),
            Err(rustix::io::Errno::WOULDBLOCK) if Instant::now() < deadline => {
                std::thread::sleep(Duration::from_millis(5));
            }
            Err(rustix::io::Errno::WOULDBLOCK) => {
                return Err(JournalError::Locked { path: path.into(), holder: holder(file) });
            }
            Err(errno) => return Err(JournalError::io("lock", path)(errno.into())),
        }
    }
}

/// Ends the process that holds the lock on a file for good: one that was frozen when its
/// supervisor died must never write beside its successor. `false` where no process holds it.
///
/// # Errors
/// Where the file cannot be opened or the holder cannot be signalled.
pub fn end_holder(path: &Path) -> Result<bool, JournalError> {
    let file = File::open(path).map_err(JournalError::io("open", path))?;
    let Some(holder) = holder(&file) else { return Ok(false) };
    let signal = || -> rustix::io::Result<()> {
        let pid = rustix::process::Pid::from_raw(holder as i32).ok_or(rustix::io::Errno::SRCH)?;
        // The descriptor names the process, not the number: if it still holds the lock after the
        // descriptor was made, it is the one that is meant.
        let process = rustix::process::pidfd_open(pid, rustix::process::PidfdFlags::empty())?;
        if self::holder(&file) == Some(holder) {
            rustix::process::pidfd_send_signal(&process, rustix::process::Signal::KILL)?;
        }
        Ok(())
    };
    match signal() {
        Ok(()) | Err(rustix::io::Errno::SRCH) => Ok(true),
        Err(errno) => Err(JournalError::io("end the writer of", path)(errno.into())),
    }
}

/// The process that holds the flock, as /proc/locks tells. That file is read in pieces, and locks
/// of others that come and go between them can hide a line: a few looks find it.
fn holder(file: &File) -> Option<u32> {
    (0..5).find_map(|_| look_for_holder(file))
}

fn look_for_holder(file: &File) -> Option<u32> {
    let meta = file.metadata().ok()?;
    let ending = format!(":{}", meta.ino());
    let locks = std::fs::read_to_string("/proc/locks").ok()?;
    locks.lines().filter(|line| line.contains("FLOCK")).find_map(|line| {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let place = fields.iter().position(|field| field.ends_with(&ending))?;
        fields.get(place.checked_sub(1)?)?.parse().ok()
    })
}
