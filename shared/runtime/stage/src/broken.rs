//! `broken_frames.txt`: frames of which an image was missing or broken, and what was wrong.

use crate::error::StageError;
use crate::names::RunFiles;
use std::collections::BTreeMap;
use std::path::PathBuf;
use tessera_journal::{Durability, write_atomically};

/// The file in a run directory; absent where all images were good.
#[derive(Clone, Debug)]
pub struct BrokenFrames {
    path: PathBuf,
}

impl BrokenFrames {
    /// What the problem of a frame begins with whose depth is whole.
    pub const COLOUR: &str = "colour left out: ";

    /// The file of a run.
    pub fn new(files: &RunFiles) -> Self {
        Self { path: files.broken_frames() }
    }

    /// What is wrong with each frame, by index; lines that are none are passed over.
    pub fn read(&self) -> BTreeMap<u64, String> {
        let text = std::fs::read(&self.path).unwrap_or_default();
        let text = String::from_utf8_lossy(&text);
        let rows = text.lines().filter_map(|line| line.split_once(' '));
        rows.filter_map(|(index, problem)| Some((index.parse().ok()?, problem.to_owned()))).collect()
    }

    /// Writes all of it, whole or not at all.
    ///
    /// # Errors
    /// The run directory cannot be written.
    pub fn write(&self, frames: &BTreeMap<u64, String>) -> Result<(), StageError> {
        let line = |(index, problem): (&u64, &String)| format!("{index} {}\n", problem.replace('\n', " "));
        let text: String = std::iter::once("# frame, what is wrong with it\n".to_owned())
            .chain(frames.iter().map(line))
            .collect();
        write_atomically(&self.path, Durability::Scratch, |writer| writer.write_all(text.as_bytes())).map_err(
            |e| StageError::RunFile { path: self.path.clone(), problem: format!("cannot write: {e}") },
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let file = BrokenFrames::new(&RunFiles::new(folder.path()));
        assert!(file.read().is_empty());
        let frames: BTreeMap<u64, String> =
            [(7, "d.png: gone".to_owned()), (30, "two\nlines".to_owned())].into();
        file.write(&frames).unwrap();
        let read = file.read();
        assert_eq!((read.len(), read[&7].as_str(), read[&30].as_str()), (2, "d.png: gone", "two lines"));
    }
}
