//! What is run.

use serde::{Deserialize, Serialize};

/// The source and how it is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RunSettings {
    /// A folder in the TUM layout, or a simulated world: `room`, `corridor`, `wall`, `house`.
    pub source: String,
    /// A camera file or the name of a built-in camera; empty: the source's own.
    pub camera: String,
    /// Frames to process at most; 0: all.
    pub frames: u64,
    /// Frames come at the source's own rate and the newest wins, instead of each in order.
    pub live: bool,
    /// Frames are decoded into memory before the first is sent.
    pub preload: bool,
    /// Go on where the source looks wrong (depth units that no room can have).
    pub force: bool,
    /// Align and optimise throw their state away after so many frames and read it back; 0: never.
    /// For tests: the outputs stay the same bytes.
    pub forget_every: u64,
}

impl Default for RunSettings {
    fn default() -> Self {
        Self {
            source: "room".to_owned(),
            camera: String::new(),
            frames: 0,
            live: false,
            preload: false,
            force: false,
            forget_every: 0,
        }
    }
}

impl RunSettings {
    /// Checks every value.
    ///
    /// # Errors
    /// `key is value, expected rule` for the first that cannot be.
    pub fn check(&self) -> Result<(), String> {
        if self.source.trim().is_empty() {
            return Err("source is empty, expected a folder or one of room, corridor, wall, house".to_owned());
        }
        Ok(())
    }
}
