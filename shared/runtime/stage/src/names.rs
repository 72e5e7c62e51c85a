//! The files of a run directory that the stages write and read.

use std::path::{Path, PathBuf};

/// Paths inside a run directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunFiles {
    /// The run directory.
    pub dir: PathBuf,
}

impl RunFiles {
    /// Paths inside `dir`.
    pub fn new(dir: &Path) -> Self {
        Self { dir: dir.into() }
    }

    /// What is run, by whom, with which camera.
    pub fn run_file(&self) -> PathBuf {
        self.dir.join("run.json")
    }

    /// Every setting that is used.
    pub fn config(&self) -> PathBuf {
        self.dir.join("config.toml")
    }

    /// What the aligner did.
    pub fn align_journal(&self) -> PathBuf {
        self.dir.join("align.journal")
    }

    /// What the optimiser did.
    pub fn optimise_journal(&self) -> PathBuf {
        self.dir.join("optimise.journal")
    }

    /// The aligner's state as it was some records ago.
    pub fn align_checkpoint(&self) -> PathBuf {
        self.dir.join("align.checkpoint")
    }

    /// The optimiser's state as it was some records ago.
    pub fn optimise_checkpoint(&self) -> PathBuf {
        self.dir.join("optimise.checkpoint")
    }

    /// Surfaces of the keyframes.
    pub fn store(&self) -> PathBuf {
        self.dir.join("keyframes.store")
    }

    /// What all processes have to say.
    pub fn log(&self) -> PathBuf {
        self.dir.join("log.txt")
    }

    /// Which start of a camera's own program has been heard, and how it counts.
    pub fn camera_session(&self) -> PathBuf {
        self.dir.join("camera.session")
    }

    /// Frames of which an image was missing or broken.
    pub fn broken_frames(&self) -> PathBuf {
        self.dir.join("broken_frames.txt")
    }

    /// When the base of a fleet was last heard of.
    pub fn base_contact(&self) -> PathBuf {
        self.dir.join("base.contact")
    }

    /// The last answer of a base to a request.
    pub fn base_answer(&self) -> PathBuf {
        self.dir.join("base.answer")
    }

    /// When the first frame of a live run was due.
    pub fn live_clock(&self) -> PathBuf {
        self.dir.join("live.clock")
    }

    /// The frame of a live run whose pose was sent last ahead of its record.
    pub fn live_posed(&self) -> PathBuf {
        self.dir.join("live.posed")
    }
}
