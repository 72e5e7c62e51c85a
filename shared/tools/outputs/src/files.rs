//! Outputs appear whole or not at all.

use crate::ToolError;
use std::io::{self, Write};
use std::path::Path;
use tessera_journal::{Durability, write_atomically};

/// Writes an output atomically.
///
/// # Errors
/// Names the file and what the system said; where the path names no file.
pub fn write_file(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> Result<(), ToolError> {
    if path.file_name().is_none() {
        return Err(ToolError::Arguments(format!("{}: expected the path of a file", path.display())));
    }
    write_atomically(path, Durability::Output, fill).map_err(|error| ToolError::write(path, error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.txt");
        write_file(&path, |writer| writer.write_all(b"old")).unwrap();
        let full = write_file(&path, |writer| {
            writer.write_all(b"half")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        });
        let message = full.unwrap_err().to_string();
        assert!(message.contains("a.txt: cannot write: no storage space"), "{message}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let message = write_file(Path::new("no/where/a.txt"), |_| Ok(())).unwrap_err().to_string();
        assert!(message.starts_with("no/where/a.txt: cannot write:"), "{message}");
    }
}
