//! Positions of a stage's state in both journals.

use crate::names::RunFiles;
use crate::{ALIGN_JOURNAL, OPTIMISE_JOURNAL};
use serde::{Deserialize, Serialize};
use std::path::Path;
use tessera_journal::Mark;

/// What of both journals has gone into a state.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Marks {
    /// Records of the aligner before it have been taken in.
    pub align: Mark,
    /// Records of the optimiser before it have been taken in.
    pub optimise: Mark,
}

/// What a checkpoint holds: a state, and where it stands.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct StateAt<T> {
    /// Where it stands.
    pub marks: Marks,
    /// A fold over what lies before.
    pub state: T,
}

impl Marks {
    /// Whether both journals still have the records before the marks.
    pub fn fits(&self, files: &RunFiles) -> bool {
        let fits = |mark: &Mark, path: &Path, kind| mark.fits(path, kind).unwrap_or(false);
        fits(&self.align, &files.align_journal(), ALIGN_JOURNAL.name)
            && fits(&self.optimise, &files.optimise_journal(), OPTIMISE_JOURNAL.name)
    }

    /// Bytes of both journals before the marks.
    pub fn len_bytes(&self) -> u64 {
        self.align.len_bytes().saturating_add(self.optimise.len_bytes())
    }
}
