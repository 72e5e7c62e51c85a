//! Replacing a file as a whole: written beside it, then renamed over it.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};

/// What a file must survive, and who may read it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Durability {
    /// Scratch of a run (checkpoints, clocks): survives the death of any process; a power loss may
    /// take it. Private to the user.
    Scratch,
    /// What a run rests on (`run.json`, `config.toml`): forced to disk with its name before the
    /// call returns. Private to the user.
    RunState,
    /// Outputs for others: they can be written again from the journals, so they are as durable as
    /// scratch; permissions by the user's mask.
    Output,
}

/// Replaces the file at `path` by what `fill` writes: readers and a killed writer's successor find
/// the old file or the new one, never a part.
///
/// The file beside it ([`partial_path`]) has a fixed name, so that the next writer removes what a killed
/// one left.
///
/// # Errors
/// The first error of `fill` or of the system; the old file then stays.
pub fn write_atomically(
    path: &Path,
    durability: Durability,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<()> {
    let partial = partial_path(path);
    let write = || -> io::Result<()> {
        // What a killed writer left may have other permissions.
        let _ = fs::remove_file(&partial);
        let mode = if durability == Durability::Output { 0o666 } else { 0o600 };
        let file = OpenOptions::new().write(true).create(true).truncate(true).mode(mode).open(&partial)?;
        let mut writer = BufWriter::new(file);
        fill(&mut writer)?;
        let file = writer.into_inner().map_err(io::IntoInnerError::into_error)?;
        if durability == Durability::RunState {
            file.sync_all()?;
        }
        fs::rename(&partial, path)?;
        if durability == Durability::RunState {
            // The new name is an entry of the folder: without this a power loss may undo it.
            sync_folder_of(path)?;
        }
        Ok(())
    };
    write().inspect_err(|_| {
        // The first error is the one to report.
        let _ = fs::remove_file(&partial);
    })
}

/// Forces the name of a file to disk, which is an entry of its folder.
///
/// # Errors
/// Where the folder cannot be opened or the system refuses.
pub fn sync_folder_of(path: &Path) -> io::Result<()> {
    File::open(folder_of(path))?.sync_all()
}

/// The file beside `path` that is renamed over it: `.NAME.partial`.
pub fn partial_path(path: &Path) -> PathBuf {
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(".partial");
    path.with_file_name(name)
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt;

    const ALL: [Durability; 3] = [Durability::Scratch, Durability::RunState, Durability::Output];

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        for durability in ALL {
            let dir = tempfile::tempdir().unwrap();
            let path = dir.path().join("a.txt");
            write_atomically(&path, durability, |writer| writer.write_all(b"old")).unwrap();
            let full = write_atomically(&path, durability, |writer| {
                writer.write_all(b"half")?;
                Err(io::Error::from(io::ErrorKind::StorageFull))
            });
            assert_eq!(full.unwrap_err().kind(), io::ErrorKind::StorageFull);
            assert_eq!(fs::read(&path).unwrap(), b"old");
            assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
            // What a killed writer left is removed.
            fs::write(partial_path(&path), "a longer text than the new one").unwrap();
            write_atomically(&path, durability, |writer| writer.write_all(b"new")).unwrap();
            assert_eq!(fs::read(&path).unwrap(), b"new");
            assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
            let is_private = fs::metadata(&path).unwrap().permissions().mode() & 0o077 == 0;
            assert!(is_private || durability == Durability::Output);
        }
    }

    #[test]
    fn a_missing_folder_is_an_error() {
        let missing = write_atomically(Path::new("no/where/a.txt"), Durability::RunState, |_| Ok(()));
        assert_eq!(missing.unwrap_err().kind(), io::ErrorKind::NotFound);
        assert_eq!(partial_path(Path::new("a.txt")), Path::new(".a.txt.partial"));
    }
}
