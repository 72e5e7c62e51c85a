//! Session of a camera's program: its images counted as frames of the run.

use serde::{Deserialize, Serialize};
use tessera_journal::{Durability, write_atomically};
use tessera_messages::CameraFrame;
use tessera_stage::{StageContext, StageError};

/// Kept in the run directory: a restarted sensor counts what came while it was dead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Session {
    /// As the publisher calls it.
    session: u64,
    /// An image of the session.
    image: u64,
    /// The frame that it is.
    frame: u64,
    /// The newest frame with which relocalisation was asked for; 0: none.
    #[serde(default)]
    relocalise_from: u64,
}

impl Session {
    /// The session of an earlier life of the sensor.
    pub(super) fn read(context: &StageContext) -> Option<Self> {
        let text = std::fs::read_to_string(context.files.camera_session()).ok()?;
        serde_json::from_str(&text).ok()
    }

    /// A new session behind `last`: its image is the run's next frame.
    pub(super) fn begin(
        context: &StageContext,
        last: Option<Self>,
        header: &CameraFrame,
        next: u64,
    ) -> Result<Self, StageError> {
        // What the last one asked for with a frame that was never sent is asked for with the next one.
        let relocalise_from = last.map_or(0, |last| last.relocalise_from.min(next));
        let session = Self { session: header.session, image: header.index, frame: next, relocalise_from };
        session.write(context)?;
        Ok(session)
    }

    /// Keeps that relocalisation was asked for with a frame.
    pub(super) fn ask_relocalisation(
        &mut self,
        context: &StageContext,
        frame: u64,
    ) -> Result<(), StageError> {
        self.relocalise_from = frame;
        self.write(context)
    }

    /// From which frame on relocalisation is asked for, as frame `index` tells: 0 before that frame.
    pub(super) fn asked_by(&self, index: u64) -> u64 {
        if self.relocalise_from <= index { self.relocalise_from } else { 0 }
    }

    fn write(&self, context: &StageContext) -> Result<(), StageError> {
        let path = context.files.camera_session();
        let wrong = |problem: String| StageError::RunFile { path: path.clone(), problem };
        let text = serde_json::to_string(self).map_err(|e| wrong(e.to_string()))?;
        write_atomically(&path, Durability::Scratch, |writer| writer.write_all(text.as_bytes()))
            .map_err(|e| wrong(format!("cannot write: {e}")))
    }

    /// Whether an image states this session.
    pub(super) fn is_of(&self, header: &CameraFrame) -> bool {
        header.session == self.session
    }

    /// The frame that an image of this session is; `None` for another session, or an image from
    /// before this one began.
    pub(super) fn frame(&self, header: &CameraFrame) -> Option<u64> {
        let since = header.index.checked_sub(self.image).filter(|_| self.is_of(header))?;
        self.frame.checked_add(since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_stay_gaps_and_other_sessions_are_others() {
        let session = Session { session: 5, image: 100, frame: 3, relocalise_from: 0 };
        let frame = |session, index| CameraFrame { session, index, ..CameraFrame::default() };
        assert_eq!(session.frame(&frame(5, 100)), Some(3));
        assert_eq!(session.frame(&frame(5, 107)), Some(10));
        assert_eq!(session.frame(&frame(5, 99)), None);
        assert_eq!(session.frame(&frame(6, 100)), None);
        let asking = Session { relocalise_from: 7, ..session };
        assert_eq!([6, 7, 90].map(|index| asking.asked_by(index)), [0, 7, 7]);
    }
}
