//! Registry of this user's current runs, by name: one small file each, locked while it lives.

use crate::cleanup::remove_everything;
use crate::error::TransportError;
use crate::identity::{RunIdentity, existing_private_folder, private_folder};
use rustix::fs::{FlockOperation, flock};
use std::collections::BTreeSet;
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read};
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What the registry says of a run.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct RunEntry {
    /// The run's name.
    pub name: String,
    /// Its supervisor's process id.
    pub pid: u32,
    /// Its run directory, absolute.
    pub run_dir: PathBuf,
    /// Its shared memory.
    pub identity: RunIdentity,
}

/// A run in the registry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Registered {
    /// What its file says.
    pub entry: RunEntry,
    /// Whether its supervisor lives.
    pub is_alive: bool,
}

/// A name taken by this process; free again when it is dropped or the process ends.
#[derive(Debug)]
pub struct RunClaim {
    /// What the registry says of this run.
    pub entry: RunEntry,
    path: PathBuf,
    /// Holds the lock.
    _file: File,
}

/// Checks that a run's name is harmless as a file name.
///
/// # Errors
/// [`TransportError::Name`].
pub fn check_name(name: &str) -> Result<(), TransportError> {
    let fits = (1..=64).contains(&name.len())
        && !name.starts_with(['.', '-'])
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b));
    if fits { Ok(()) } else { Err(TransportError::Name { name: name.into() }) }
}

impl RunClaim {
    /// Takes the name for a run in `run_dir`, with fresh shared memory; what a dead run of that
    /// name left there is removed, and what [`remove_unnamed`] finds.
    ///
    /// # Errors
    /// Where a living run has the name.
    pub fn take(name: &str, run_dir: &Path) -> Result<Self, TransportError> {
        check_name(name)?;
        let (path, file, before) = lock(name)?;
        if let Some(entry) = before {
            remove_everything(&entry.identity)?;
        }
        remove_unnamed()?;
        let making = lock_folder(&path, FlockOperation::LockShared)?;
        let run_dir = std::path::absolute(run_dir).map_err(TransportError::io("find", run_dir))?;
        let entry = RunEntry {
            name: name.into(),
            pid: std::process::id(),
            run_dir,
            identity: RunIdentity::create()?,
        };
        let text = serde_json::to_vec(&entry)
            .map_err(|e| TransportError::io("write", &path)(std::io::Error::other(e)))?;
        file.set_len(0)
            .and_then(|()| file.write_all_at(&text, 0))
            .map_err(TransportError::io("write", &path))?;
        drop(making);
        Ok(Self { entry, path, _file: file })
    }

    /// Ends the run: removes its shared memory and frees the name, as dropping it does, but says
    /// what cannot be removed.
    ///
    /// # Errors
    /// Where something cannot be removed.
    pub fn release(self) -> Result<(), TransportError> {
        self.remove()
    }

    fn remove(&self) -> Result<(), TransportError> {
        remove_everything(&self.entry.identity)?;
        // Removed while locked: a process that opened it meanwhile finds a name without a file.
        match std::fs::remove_file(&self.path) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(TransportError::io("remove", &self.path)(error));
            }
            _ => {}
        }
        if let Some(folder) = self.path.parent() {
            // Fails while another run is in it, and that is right.
            let _ = std::fs::remove_dir(folder);
        }
        Ok(())
    }
}

impl Drop for RunClaim {
    fn drop(&mut self) {
        // What stays behind here is what `clean` is for.
        let _ = self.remove();
    }
}

/// How long the lock may be held by none that runs under the name: by a stage that a supervisor was about to
/// start when it died, which has the descriptor until it is another program, or by a look at the registry.
const LEFT_BEHIND: Duration = Duration::from_secs(2);

/// Opens and locks the file of a name; answers what a dead run wrote there.
fn lock(name: &str) -> Result<(PathBuf, File, Option<RunEntry>), TransportError> {
    let began = Instant::now();
    loop {
        let path = private_folder()?.join(format!("{name}.run"));
        let opened = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .mode(0o600)
            .custom_flags(rustix::fs::OFlags::NOFOLLOW.bits() as i32)
            .open(&path);
        let file = match opened {
            Ok(file) => file,
            // The last run that was in the folder has just removed it.
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Err(error) => return Err(TransportError::io("open", &path)(error)),
        };
        let before = read_entry(&file);
        if flock(&file, FlockOperation::NonBlockingLockExclusive).is_err() {
            let (pid, run_dir) = before.map_or((0, PathBuf::new()), |entry| (entry.pid, entry.run_dir));
            if !is_running(pid) && began.elapsed() < LEFT_BEHIND {
                std::thread::sleep(Duration::from_millis(5));
                continue;
            }
            return Err(TransportError::NameInUse { name: name.into(), pid, run_dir });
        }
        // A run that ended between the two calls has removed the file that is locked now.
        let locked = file.metadata().map_err(TransportError::io("look at", &path))?;
        if std::fs::metadata(&path).is_ok_and(|there| there.ino() == locked.ino()) {
            return Ok((path, file, before));
        }
    }
}

/// Whether there is a process of this number that has not ended.
fn is_running(pid: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // The state stands behind the name, which is in parentheses and may hold any letters.
    let state = stat.rsplit_once(") ").and_then(|(_, rest)| rest.chars().next());
    state.is_some_and(|state| !['Z', 'X'].contains(&state))
}

fn read_entry(file: &File) -> Option<RunEntry> {
    let mut text = String::new();
    file.take(1 << 16).read_to_string(&mut text).ok()?;
    let entry: RunEntry = serde_json::from_str(&text).ok()?;
    let base = existing_private_folder().ok()??;
    // The paths decide what gets removed: they must be ours.
    let prefix = &entry.identity.prefix;
    let is_ours = RunIdentity::is_prefix(prefix) && entry.identity == RunIdentity::of(&base, prefix);
    is_ours.then_some(entry)
}

/// Locks the private folder in which a file lies. All who make a run's folder hold it together until the registry
/// names that; who removes what is not named holds it alone.
fn lock_folder(file: &Path, operation: FlockOperation) -> Result<Option<File>, TransportError> {
    let Some(base) = file.parent() else { return Ok(None) };
    let folder = File::open(base).map_err(TransportError::io("open", base))?;
    Ok(rustix::io::retry_on_intr(|| flock(&folder, operation)).is_ok().then_some(folder))
}

/// Removes what supervisors left that were killed before the registry named their runs: folders and configurations
/// that no entry names, and empty entries. Nothing where a run is being made, or an entry cannot be read.
///
/// # Errors
/// Where something is there and cannot be removed.
pub fn remove_unnamed() -> Result<(), TransportError> {
    let Some(base) = existing_private_folder()? else { return Ok(()) };
    let Ok(Some(_alone)) = lock_folder(&base.join("any.run"), FlockOperation::NonBlockingLockExclusive)
    else {
        return Ok(());
    };
    let mut named = BTreeSet::new();
    let items = std::fs::read_dir(&base).and_then(|items| items.map(|item| Ok(item?.path())).collect());
    // An entry that is overlooked would cost a living run its folder.
    let Ok::<Vec<PathBuf>, _>(items) = items else { return Ok(()) };
    let (files, others): (Vec<_>, Vec<_>) =
        items.into_iter().partition(|path| path.extension().is_some_and(|e| e == "run"));
    for path in files {
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Err(_) => return Ok(()),
        };
        match read_entry(&file) {
            Some(entry) => drop(named.insert(entry.identity.prefix)),
            None if file.metadata().is_ok_and(|about| about.len() == 0) => {
                if flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok() {
                    let _ = std::fs::remove_file(&path);
                }
            }
            // Of another version.
            None => return Ok(()),
        }
    }
    for path in others {
        let prefix = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or_default();
        if RunIdentity::is_prefix(prefix) && !named.contains(prefix) {
            remove_everything(&RunIdentity::of(&base, prefix))?;
        }
    }
    // Fails while a run is in it.
    let _ = std::fs::remove_dir(&base);
    Ok(())
}

/// All runs that have a file in the registry, by name.
///
/// # Errors
/// Where the private folder cannot be read.
pub fn registered_runs() -> Result<Vec<Registered>, TransportError> {
    let Some(base) = existing_private_folder()? else { return Ok(Vec::new()) };
    let mut runs = Vec::new();
    let items = match std::fs::read_dir(&base) {
        Ok(items) => items,
        // The last run that was in the folder has just removed it.
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(runs),
        Err(error) => return Err(TransportError::io("read", &base)(error)),
    };
    for item in items {
        let path = item.map_err(TransportError::io("read", &base))?.path();
        if path.extension().is_none_or(|extension| extension != "run") {
            continue;
        }
        let Ok(file) = File::open(&path) else { continue };
        let Some(entry) = read_entry(&file) else { continue };
        // A shared lock does not disturb: it is held for an instant and only where it is free.
        let is_alive = flock(&file, FlockOperation::NonBlockingLockShared).is_err();
        runs.push(Registered { entry, is_alive });
    }
    runs.sort_by(|a, b| a.entry.name.cmp(&b.entry.name));
    Ok(runs)
}

/// The runs of [`registered_runs`] that go on.
///
/// # Errors
/// As there.
pub fn living_runs() -> Result<Vec<RunEntry>, TransportError> {
    Ok(registered_runs()?.into_iter().filter(|run| run.is_alive).map(|run| run.entry).collect())
}

impl RunEntry {
    /// Whether it goes on, and is not another one of the same name.
    ///
    /// # Errors
    /// As [`registered_runs`].
    pub fn is_alive(&self) -> Result<bool, TransportError> {
        Ok(living_runs()?.iter().any(|run| run.identity == self.identity))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_could_leave_the_folder_are_refused() {
        for name in ["a", "room-1", "2026.11.21_x"] {
            check_name(name).unwrap();
        }
        for name in ["", "..", ".x", "-x", "a/b", "a b", "ä", &"x".repeat(65)] {
            assert!(check_name(name).is_err(), "{name}");
        }
    }

    #[test]
    fn a_lock_that_is_left_by_a_dead_run_is_waited_for() {
        let name = format!("test-registry-left-{}", std::process::id());
        let dir = tempfile::tempdir().unwrap();
        let _other = RunClaim::take(&format!("{name}-other"), dir.path()).unwrap();
        let claim = RunClaim::take(&name, dir.path()).unwrap();
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        let of_dead = serde_json::to_vec(&RunEntry { pid: child.id(), ..claim.entry.clone() }).unwrap();
        let (path, identity) = (claim.path.clone(), claim.entry.identity.clone());
        drop(claim);
        std::fs::write(&path, of_dead).unwrap();
        // What a stage between its fork and its exec has.
        let held = File::open(&path).unwrap();
        flock(&held, FlockOperation::NonBlockingLockExclusive).unwrap();
        let began = Instant::now();
        let letting_go = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(200));
            drop(held);
        });
        let again = RunClaim::take(&name, dir.path()).unwrap();
        assert!(began.elapsed() >= Duration::from_millis(200));
        assert!(again.entry.identity != identity && again.entry.pid == std::process::id());
        letting_go.join().unwrap();
    }

    #[test]
    fn what_was_made_before_a_run_had_its_entry_is_removed_by_the_next_start() {
        let name = |what: &str| format!("test-registry-{what}-{}", std::process::id());
        let dir = tempfile::tempdir().unwrap();
        let other = RunClaim::take(&name("kept"), dir.path()).unwrap();
        let making = lock_folder(&other.path, FlockOperation::LockShared).unwrap();
        let unnamed = RunIdentity::create().unwrap();
        let empty = other.path.with_file_name(format!("{}.run", name("empty")));
        File::create(&empty).unwrap();
        // As while its supervisor is about to write the entry.
        drop(RunClaim::take(&name("meanwhile"), dir.path()).unwrap());
        assert!(unnamed.root.exists() && unnamed.is_there());
        // As when it was killed.
        drop(making);
        // Another test may be making a run.
        let began = Instant::now();
        while (unnamed.root.exists() || empty.exists()) && began.elapsed() < Duration::from_secs(10) {
            drop(RunClaim::take(&name("next"), dir.path()).unwrap());
        }
        assert!(!unnamed.root.exists() && !unnamed.is_there() && !empty.exists());
        assert!(other.entry.identity.root.exists() && other.entry.identity.is_there());
    }

    #[test]
    fn a_name_is_taken_once_and_free_after_release() {
        let name = format!("test-registry-{}", std::process::id());
        let dir = tempfile::tempdir().unwrap();
        // Keeps the private folder, which goes with the last run in it.
        let _other = RunClaim::take(&format!("{name}-other"), dir.path()).unwrap();
        let claim = RunClaim::take(&name, dir.path()).unwrap();
        let second = RunClaim::take(&name, dir.path()).unwrap_err().to_string();
        assert!(second.contains(&format!("pid {}", std::process::id())), "{second}");
        let find = || registered_runs().unwrap().into_iter().find(|run| run.entry.name == name);
        assert!(find().unwrap().is_alive);
        let root = claim.entry.identity.root.clone();
        // As after a kill: the lock goes, the files stay.
        let left = std::fs::read(&claim.path).unwrap();
        let path = claim.path.clone();
        drop(claim);
        std::fs::create_dir_all(&root).unwrap();
        std::fs::write(&path, left).unwrap();
        assert!(!find().unwrap().is_alive);
        let again = RunClaim::take(&name, dir.path()).unwrap();
        assert!(!root.exists(), "what the dead run left is gone");
        let (root, config) = (again.entry.identity.root.clone(), again.entry.identity.config_file.clone());
        again.release().unwrap();
        assert!(find().is_none() && !root.exists() && !config.exists());
    }
}
