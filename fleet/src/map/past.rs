//! A run as it was at some byte of its journal: what a map and an answer are made of.

use crate::copies::arrivals::{Arrival, CopyForm, Extent};
use crate::error::FleetError;
use crate::map::received::{ReceivedSurfaces, RunSurfaces};
use std::path::{Path, PathBuf};
use tessera_journal::Follower;
use tessera_outputs::{Replay, read_settings};
use tessera_settings::Settings;
use tessera_slam::{AlignRecord, FrameHistory, FrameRecord, TrackerState};
use tessera_stage::{ALIGN_JOURNAL, RunFile, RunFiles, StoredKeyframes};
use tessera_surface::Grid;

/// A run up to some byte.
pub(crate) struct Past {
    /// What it was run with.
    pub run: RunFile,
    /// Its settings.
    pub settings: Settings,
    /// Its map.
    pub state: TrackerState,
    /// Its frames, where they were asked for.
    pub replay: Replay,
    /// The surfaces of its keyframes.
    pub(crate) surfaces: RunSurfaces,
    /// The journal that counts.
    pub journal: Prefix,
}

/// A journal up to some byte.
pub struct Prefix {
    path: PathBuf,
    bytes: u64,
}

impl Prefix {
    /// The first `bytes` of the aligner's journal of a run.
    pub fn new(files: &RunFiles, bytes: u64) -> Self {
        Self { path: files.align_journal(), bytes }
    }

    /// Hands over every whole record, in order.
    ///
    /// # Errors
    /// Where the journal cannot be read.
    pub fn visit_all(&self, take: &mut dyn FnMut(AlignRecord)) -> Result<(), FleetError> {
        if self.bytes == 0 {
            return Ok(());
        }
        let mut follower = Follower::<AlignRecord>::open(&self.path, ALIGN_JOURNAL)?;
        while follower.mark().len_bytes() < self.bytes {
            match follower.next()? {
                Some(record) => take(record),
                None => break,
            }
        }
        Ok(())
    }
}

impl FrameHistory for Prefix {
    fn visit(&self, take: &mut dyn FnMut(&FrameRecord)) {
        // It was read a moment ago; a file that has become unreadable ends the history, and frames keep
        // the poses that they have.
        let _ = self.visit_all(&mut |record| {
            if let AlignRecord::Frame(frame) = record {
                take(&frame);
            }
        });
    }
}

impl Past {
    /// Reads so much of a run, with its frames.
    ///
    /// # Errors
    /// Names the file that cannot be used, and why.
    pub fn read(
        base: &Path,
        arrival: &Arrival,
        extent: Extent,
        with_frames: bool,
    ) -> Result<Self, FleetError> {
        let folder = arrival.folder(base);
        let files = RunFiles::new(&folder);
        let run = RunFile::read_recorded(&files)?;
        let settings = read_settings(&files)?;
        let mut surfaces = surfaces_of(&folder, arrival.form, extent, run.layout(&settings).grid)?;
        let (mut state, mut replay) = (TrackerState::default(), Replay::default());
        let journal = Prefix::new(&files, extent.align_bytes);
        let mut problem = Ok(());
        journal.visit_all(&mut |record| {
            if problem.is_ok() {
                problem = surfaces.take_unread(&record);
            }
            state.apply(&record);
            if with_frames {
                replay.apply(record);
            }
        })?;
        problem?;
        surfaces.keep_active(&state.keyframes);
        surfaces.retire_missing(&mut state);
        Ok(Self { run, settings, state, replay, surfaces, journal })
    }
}

/// The surfaces of so much of a run.
pub(crate) fn surfaces_of(
    folder: &Path,
    form: CopyForm,
    extent: Extent,
    grid: Grid,
) -> Result<RunSurfaces, FleetError> {
    Ok(match form {
        CopyForm::Whole => RunSurfaces::Whole(StoredKeyframes::open(&RunFiles::new(folder).store(), grid)?),
        CopyForm::Kept => RunSurfaces::Received(ReceivedSurfaces::read(folder, extent.n_surfaces, grid)?),
    })
}
