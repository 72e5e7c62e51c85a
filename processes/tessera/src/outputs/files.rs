//! Outputs appear whole or not at all.

use crate::exit::CommandError;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Writes `folder/name` through a file beside it that takes its place once it is complete.
///
/// The file beside it has a fixed name: what a killed command left is written over by the next.
///
/// # Errors
/// Names the file and what the system said.
pub(crate) fn write_whole(
    folder: &Path,
    name: &str,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), CommandError> {
    let (path, partial) = (folder.join(name), folder.join(format!(".{name}.partial")));
    let write = || -> io::Result<()> {
        let mut writer = BufWriter::new(File::create(&partial)?);
        fill(&mut writer)?;
        writer.into_inner().map_err(io::IntoInnerError::into_error)?;
        fs::rename(&partial, &path)
    };
    write().map_err(|error| {
        // The first error is the one to tell.
        let _ = fs::remove_file(&partial);
        CommandError::write(&path, error)
    })
}

/// As [`write_whole`], for a file that a user named.
///
/// # Errors
/// As there, and where the path names no file.
pub(crate) fn write_file(
    path: &Path,
    fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), CommandError> {
    let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
        return Err(CommandError::Arguments(format!("{}: expected the path of a file", path.display())));
    };
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    write_whole(folder, name, fill)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        write_whole(dir.path(), "a.txt", |writer| writer.write_all(b"old")).unwrap();
        let full = write_whole(dir.path(), "a.txt", |writer| {
            writer.write_all(b"half")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        });
        let message = full.unwrap_err().to_string();
        assert!(message.contains("a.txt: cannot write: no storage space"), "{message}");
        assert_eq!(fs::read(dir.path().join("a.txt")).unwrap(), b"old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let message = write_whole(Path::new("no/where"), "a.txt", |_| Ok(())).unwrap_err().to_string();
        assert!(message.starts_with("no/where/a.txt: cannot write:"), "{message}");
    }
}
