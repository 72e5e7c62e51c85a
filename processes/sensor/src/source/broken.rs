//! Frames with a missing or broken image: each is named once, and there may not be too many.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use tessera_stage::{BrokenFrames, StageContext, StageError};

/// Broken frames so far, of this life of the sensor and those before.
pub(super) struct Broken {
    most: u64,
    n_frames: u64,
    file: BrokenFrames,
    known: Mutex<BTreeMap<u64, String>>,
}

impl Broken {
    /// What the run directory knows; `n_frames` of the source.
    pub(super) fn new(context: &StageContext, n_frames: u64) -> Self {
        let file = BrokenFrames::new(&context.files);
        let known = Mutex::new(file.read());
        Self { most: context.settings.source.most_broken(n_frames), n_frames, file, known }
    }

    /// Whether a broken image is borne at all.
    pub(super) fn is_borne(&self) -> bool {
        self.most > 0
    }

    /// Takes a frame in, with what is wrong with it. Where only colour is, the frame goes on with its depth:
    /// the first is named in the log, and none counts against the limit.
    ///
    /// # Errors
    /// There are too many, or the run directory cannot be written.
    pub(super) fn note(&self, index: u64, problem: &str, is_of_colour: bool) -> Result<(), StageError> {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let is_colour = |problem: &str| problem.starts_with(BrokenFrames::COLOUR);
        let text =
            if is_of_colour { format!("{}{problem}", BrokenFrames::COLOUR) } else { problem.to_owned() };
        let is_first = !known.values().any(|known| is_colour(known));
        if known.insert(index, text).is_none() {
            match (is_of_colour, is_first) {
                (false, _) => tracing::warn!(frame = index, "an image is left out: {problem}"),
                (true, true) => {
                    tracing::warn!(
                        frame = index,
                        "colour is left out: {problem} (further ones: broken_frames.txt)"
                    );
                }
                (true, false) => tracing::debug!(frame = index, "colour is left out: {problem}"),
            }
            self.file.write(&known)?;
        }
        let n_broken = known.values().filter(|problem| !is_colour(problem)).count();
        if n_broken as u64 > self.most {
            return Err(StageError::Input(format!(
                "{problem}; {} of {} frames have a missing or broken image, expected at most {} (source.max_broken_share)",
                n_broken, self.n_frames, self.most
            )));
        }
        Ok(())
    }
}
