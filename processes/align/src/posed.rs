//! The frame whose pose was sent ahead of its record, for a successor (live).
//!
//! A pose goes out as soon as it is known; what its frame means for the map follows. Where align dies in
//! between, the frame comes again. A lossless run takes it as the next one and finds the same. A live one
//! would take a newer frame or a correction first, so its successor is told: the record then holds the pose
//! that was sent.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::path::Path;
use tessera_stage::StageError;

/// Index of the frame whose pose was sent last ahead of its record, in a file of eight bytes.
pub(crate) struct PosedFrame {
    /// None in a lossless run.
    file: Option<File>,
    /// What the file held when it was opened.
    of_predecessor: Option<u64>,
}

impl PosedFrame {
    /// Opens or makes the file of a live run; that of a machine that was cut off may hold anything.
    pub(crate) fn open(path: &Path, is_live: bool) -> Result<Self, StageError> {
        let mut posed = Self { file: None, of_predecessor: None };
        if is_live {
            let file = File::options().read(true).write(true).create(true).truncate(false).open(path);
            let file = file.map_err(|error| StageError::RunFile {
                path: path.to_owned(),
                problem: format!("cannot open: {error}"),
            })?;
            let mut bytes = [0; 8];
            posed.of_predecessor =
                file.read_exact_at(&mut bytes, 0).is_ok().then(|| u64::from_le_bytes(bytes));
            posed.file = Some(file);
        }
        Ok(posed)
    }

    /// Notes that the pose of frame `index` is about to be sent; answers whether it may be. On a full disk it may
    /// not: then it goes out behind its record, where the journal says what is wrong.
    pub(crate) fn note(&self, index: u64) -> bool {
        self.file.as_ref().is_none_or(|file| file.write_all_at(&index.to_le_bytes(), 0).is_ok())
    }

    /// The frame that a predecessor had sent the pose of, if it is still to be recorded.
    pub(crate) fn due(&self, next_index: u64) -> Option<u64> {
        self.of_predecessor.filter(|index| *index >= next_index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_successor_hears_of_a_pose_that_has_no_record() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.posed");
        let first = PosedFrame::open(&path, true).unwrap();
        assert_eq!(first.due(0), None);
        assert!(first.note(7) && first.note(300));
        assert_eq!(first.due(0), None, "its own");
        let successor = PosedFrame::open(&path, true).unwrap();
        assert_eq!(successor.due(300), Some(300));
        assert_eq!(successor.due(301), None, "it was recorded");
        std::fs::write(&path, b"cut").unwrap();
        assert_eq!(PosedFrame::open(&path, true).unwrap().due(0), None);
        assert!(PosedFrame::open(&folder.path().join("no/folder"), true).is_err());
    }

    #[test]
    fn a_lossless_run_needs_no_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.posed");
        assert!(PosedFrame::open(&path, false).unwrap().note(7));
        assert!(!path.exists());
    }
}
