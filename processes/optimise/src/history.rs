//! The run's frames, read from the aligner's journal when the final optimisation solves them again.

use std::cell::RefCell;
use tessera_journal::{Follower, JournalError};
use tessera_slam::{AlignRecord, FrameHistory, FrameRecord};
use tessera_stage::{ALIGN_JOURNAL, RunFiles, StageError};

/// Frames of the aligner's journal. Nothing of them is kept: their matches take some kilobytes each.
pub(crate) struct JournaledFrames<'a> {
    files: &'a RunFiles,
    failure: RefCell<Option<JournalError>>,
}

impl<'a> JournaledFrames<'a> {
    pub(crate) fn new(files: &'a RunFiles) -> Self {
        Self { files, failure: RefCell::new(None) }
    }

    /// Whether the journal could be read; to be asked before anything that rests on it is written.
    pub(crate) fn check(&self) -> Result<(), StageError> {
        self.failure.take().map_or(Ok(()), |error| Err(error.into()))
    }

    fn read(&self, take: &mut dyn FnMut(&FrameRecord)) -> Result<(), JournalError> {
        let mut records = Follower::open(&self.files.align_journal(), ALIGN_JOURNAL)?;
        while let Some(record) = records.next()? {
            if let AlignRecord::Frame(frame) = &record {
                take(frame);
            }
        }
        Ok(())
    }
}

impl FrameHistory for JournaledFrames<'_> {
    fn visit(&self, take: &mut dyn FnMut(&FrameRecord)) {
        if let Err(error) = self.read(take) {
            self.failure.replace(Some(error));
        }
    }
}
