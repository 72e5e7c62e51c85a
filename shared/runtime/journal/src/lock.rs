//! One writer at a time: an flock that the kernel frees when its holder dies.

use crate::error::JournalError;
use rustix::fs::{FlockOperation, flock};
use std::fs::File;
use std::os::unix::fs::MetadataExt;
use std::path::Path;
use std::time::Duration;

/// Time between two looks at a lock.
const LOOK: Duration = Duration::from_millis(5);

/// Takes the exclusive lock on an open file, waiting up to `wait` for its holder to end; time in which the machine
/// sleeps does not count, for the holder sleeps too.
///
/// # Errors
/// [`JournalError::Locked`] with the holder's pid when the time is over.
pub fn lock_file(file: &File, path: &Path, wait: Duration) -> Result<(), JournalError> {
    let mut left = wait;
    loop {
        match flock(file, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => return Ok(()),
            Err(rustix::io::Errno::WOULDBLOCK) if !left.is_zero() => {
                std::thread::sleep(LOOK);
                left = left.saturating_sub(LOOK);
            }
            Err(rustix::io::Errno::WOULDBLOCK) => {
                return Err(JournalError::Locked { path: path.into(), holder: holder(file) });
            }
            Err(errno) => return Err(JournalError::io("lock", path)(errno.into())),
        }
    }
}

/// Ends the process that holds the lock on a file for good: one that was frozen when its
/// supervisor died must never write beside its successor. `false` where no process is known to hold it.
///
/// # Errors
/// [`JournalError::Unproven`] where a process may hold it, and that cannot be proven: it is left alone.
/// Where the file cannot be opened or the holder cannot be signalled.
pub fn end_holder(path: &Path) -> Result<bool, JournalError> {
    let file = File::open(path).map_err(JournalError::io("open", path))?;
    let Some(pid) = holder(&file) else { return Ok(false) };
    end_if_proven(&file, path, pid).map(|()| true)
}

/// Ends a process that holds the lock on `file` by a descriptor of its own.
fn end_if_proven(file: &File, path: &Path, pid: u32) -> Result<(), JournalError> {
    let signal = || -> rustix::io::Result<bool> {
        let id = i32::try_from(pid).ok().and_then(rustix::process::Pid::from_raw);
        // The descriptor names the process, not the number: if it holds the lock after the descriptor
        // was made, it is the one that is meant.
        let process = rustix::process::pidfd_open(
            id.ok_or(rustix::io::Errno::SRCH)?,
            rustix::process::PidfdFlags::empty(),
        )?;
        if !holds_lock(pid, file) {
            return Ok(false);
        }
        rustix::process::pidfd_send_signal(&process, rustix::process::Signal::KILL)?;
        Ok(true)
    };
    match signal() {
        Ok(true) | Err(rustix::io::Errno::SRCH) => Ok(()),
        Ok(false) => Err(JournalError::Unproven { path: path.into(), pid }),
        Err(errno) => Err(JournalError::io("end the writer of", path)(errno.into())),
    }
}

/// Whether a process has this very file open and locked. Its descriptors tell: they name the file by
/// device and inode as this process sees them, on every kind of file system, and the locks that are held
/// by them.
fn holds_lock(pid: u32, file: &File) -> bool {
    let Ok(ours) = file.metadata() else { return false };
    let folder = format!("/proc/{pid}/fd");
    let descriptors = std::fs::read_dir(folder).into_iter().flatten().flatten();
    descriptors.into_iter().any(|descriptor| {
        let is_same = std::fs::metadata(descriptor.path())
            .is_ok_and(|meta| (meta.dev(), meta.ino()) == (ours.dev(), ours.ino()));
        is_same && {
            let name = descriptor.file_name();
            let info = format!("/proc/{pid}/fdinfo/{}", name.to_string_lossy());
            let info = std::fs::read_to_string(info).unwrap_or_default();
            info.lines().any(|line| line.starts_with("lock:") && line.contains("FLOCK"))
        }
    })
}

/// The process that may hold the flock, as /proc/locks tells. That file is read in pieces, and locks
/// of others that come and go between them can hide a line: a few looks find it.
fn holder(file: &File) -> Option<u32> {
    let inode = file.metadata().ok()?.ino();
    (0..5).find_map(|_| {
        let locks = std::fs::read_to_string("/proc/locks").ok()?;
        let candidates = candidates(&locks, inode);
        candidates.iter().find(|pid| holds_lock(**pid, file)).or(candidates.first()).copied()
    })
}

/// Processes with a flock on a file of this inode number, on whatever file system: the device numbers of
/// /proc/locks are not those of the files where a file system has several.
fn candidates(locks: &str, inode: u64) -> Vec<u32> {
    let ending = format!(":{inode}");
    let of_line = |line: &str| -> Option<u32> {
        let fields: Vec<&str> = line.split_whitespace().collect();
        let place = fields.iter().position(|field| field.ends_with(&ending))?;
        fields.get(place.checked_sub(1)?)?.parse().ok()
    };
    locks.lines().filter(|line| line.contains("FLOCK")).filter_map(of_line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{BufRead, BufReader};
    use std::path::PathBuf;
    use std::process::{Child, Command, Stdio};

    /// Tells [`a_holder`] which file to lock.
    const FILE_VARIABLE: &str = "TESSERA_TEST_LOCK";

    /// Not a test of its own: the process that another test starts.
    #[test]
    fn a_holder() {
        let Some(path) = std::env::var_os(FILE_VARIABLE).map(PathBuf::from) else { return };
        let file = File::open(&path).unwrap();
        lock_file(&file, &path, Duration::ZERO).unwrap();
        println!("\nlocked");
        std::thread::sleep(Duration::from_secs(600));
    }

    fn start_holder(path: &Path) -> Child {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "lock::tests::a_holder", "--nocapture"])
            .env(FILE_VARIABLE, path)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        assert!(lines.map_while(Result::ok).any(|line| line == "locked"));
        child
    }

    #[test]
    fn the_holder_is_ended_and_one_that_is_not_proven_is_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let [ours, other] = ["ours", "other"].map(|name| dir.path().join(name));
        [&ours, &other].into_iter().for_each(|path| std::fs::write(path, "").unwrap());
        let (mut holder_of_ours, mut stranger) = (start_holder(&ours), start_holder(&other));
        let file = File::open(&ours).unwrap();
        // As if the stranger's file had the inode number of ours, on another file system.
        let locks = format!("1: FLOCK  ADVISORY  WRITE {} 00:99:77 0 EOF", stranger.id());
        assert_eq!(candidates(&locks, 77), [stranger.id()]);
        assert_eq!(candidates(&locks, 7), [0; 0]);
        let error = end_if_proven(&file, &ours, stranger.id()).unwrap_err();
        assert!(error.to_string().contains(&format!("pid {}", stranger.id())), "{error}");
        assert_eq!(stranger.try_wait().unwrap(), None, "it goes on");
        assert!(end_holder(&ours).unwrap());
        assert!(!holder_of_ours.wait().unwrap().success());
        assert!(!end_holder(&ours).unwrap());
        stranger.kill().unwrap();
        stranger.wait().unwrap();
    }
}
