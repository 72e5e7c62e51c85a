//! The clock of a source that is played at its own rate.

use super::frames::Frames;
use serde::{Deserialize, Serialize};
use tessera_journal::{Durability, write_atomically};
use tessera_stage::{StageContext, StageError, monotonic_nanos};

/// When the first frame was due; kept in the run directory, so that the camera's time goes on while
/// the sensor is dead.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct LiveClock {
    /// Monotonic clock at the stamp of `first_index`, nanoseconds.
    began_nanos: u64,
    /// Index of the first frame.
    first_index: u64,
}

impl LiveClock {
    /// The clock of an earlier life of the sensor, or one that begins now.
    pub(super) fn read_or_begin(context: &StageContext, first_index: u64) -> Result<Self, StageError> {
        let path = context.files.live_clock();
        if let Ok(text) = std::fs::read_to_string(&path)
            && let Ok(clock) = serde_json::from_str(&text)
        {
            return Ok(clock);
        }
        let clock = LiveClock { began_nanos: monotonic_nanos(), first_index };
        let wrong = |problem: String| StageError::RunFile { path: path.clone(), problem };
        let text = serde_json::to_string(&clock).map_err(|e| wrong(e.to_string()))?;
        write_atomically(&path, Durability::Scratch, |writer| writer.write_all(text.as_bytes()))
            .map_err(|e| wrong(format!("cannot write: {e}")))?;
        Ok(clock)
    }

    /// When a frame is due on the monotonic clock; `None` for an index outside the source.
    pub(super) fn due_nanos(&self, frames: &Frames<'_>, index: u64) -> Option<u64> {
        let first = frames.stamp_nanos(self.first_index)?;
        let since = frames.stamp_nanos(index)?.saturating_sub(first);
        Some(self.began_nanos.saturating_add(u64::try_from(since).unwrap_or(0)))
    }
}
