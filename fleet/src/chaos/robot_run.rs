//! Replay of a finished run: a folder that grows from its first byte to its last, as if the robot were on its
//! way.

use super::verdict::difference;
use crate::copies::checked::RunFacts;
use crate::copies::surfaces::SURFACES;
use crate::error::FleetError;
use crate::wire::request::{Growing, JOURNALS, SMALL_FILES};
use std::fs::OpenOptions;
use std::io::Write;
use std::path::{Path, PathBuf};
use tessera_journal::{Chain, StoreView};
use tessera_stage::{RunFile, RunFiles, journal_slot};

/// A run and its copy that grows.
pub struct RobotRun {
    /// Its robot.
    pub robot: String,
    /// Where it is whole.
    pub original: PathBuf,
    /// Where it grows.
    pub folder: PathBuf,
    journals: [Vec<u8>; 2],
    store: Vec<u8>,
    /// Where each record of the aligner's journal begins, and the bytes of the store that all before it and
    /// itself need.
    needs: Vec<(u64, u64)>,
    /// Bytes of both journals and the store that are there now.
    written: [u64; 3],
}

impl RobotRun {
    /// Reads a finished run and begins its copy, which is empty at first but for the small files.
    ///
    /// # Errors
    /// Where the run cannot be read, has not ended, or a surface is damaged.
    pub fn begin(original: &Path, robot: &str, folder: &Path) -> Result<Self, FleetError> {
        // By its own words where it is of another version.
        RunFile::read_recorded(&RunFiles::new(original)).map_err(unusable)?;
        let read = |file: Growing| {
            let path = original.join(file.file());
            std::fs::read(&path).map_err(FleetError::io("read", &path)).map_err(unusable)
        };
        let journals = [read(JOURNALS[0])?, read(JOURNALS[1])?];
        let store = read(Growing::Store)?;
        let needs = needs(original, &journals[0])?;
        std::fs::create_dir_all(folder).map_err(FleetError::io("make", folder))?;
        for name in SMALL_FILES.into_iter().filter(|name| original.join(name).is_file()) {
            let to = folder.join(name);
            std::fs::copy(original.join(name), &to).map_err(FleetError::io("write", &to))?;
        }
        let (robot, original, folder) = (robot.to_owned(), original.to_owned(), folder.to_owned());
        Ok(Self { robot, original, folder, journals, store, needs, written: [0; 3] })
    }

    /// Bytes of journals and store when it is whole.
    pub fn len_bytes(&self) -> u64 {
        (self.journals[0].len() + self.journals[1].len() + self.store.len()) as u64
    }

    /// How a copy differs from the run; `None`: in no byte.
    ///
    /// # Errors
    /// Where a file of the run cannot be read.
    pub fn difference(&self, copy: &Path) -> Result<Option<String>, FleetError> {
        let store = copy.join(Growing::Store.file());
        if copy.join(SURFACES).is_file() {
            return difference(&self.original, copy);
        }
        let found = std::fs::metadata(&store).map_or(0, |meta| meta.len());
        let needed = self.needs.last().map_or(0, |(_, bytes)| *bytes);
        if found < needed {
            let words = format!("{}: {found} bytes, expected at least {needed}", store.display());
            return Ok(Some(words));
        }
        difference(&self.original, copy)
    }

    /// Grows until `part` of `whole` is there, as stages write: surfaces before the records that name them,
    /// and the last record as far as it has come.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn grow_to(&mut self, part: u64, whole: u64) -> Result<(), FleetError> {
        let share = |bytes: &[u8]| (bytes.len() as u128 * u128::from(part) / u128::from(whole.max(1))) as u64;
        let ends = [share(&self.journals[0]), share(&self.journals[1])];
        let n_begun = self.needs.partition_point(|(begin, _)| *begin < ends[0]);
        let needed = n_begun.checked_sub(1).map_or(0, |last| self.needs[last].1);
        let store_end = if part >= whole { self.store.len() as u64 } else { needed };
        let files = [
            (2, Growing::Store, &self.store, store_end),
            (0, JOURNALS[0], &self.journals[0], ends[0]),
            (1, JOURNALS[1], &self.journals[1], ends[1]),
        ];
        for (place, file, bytes, end) in files {
            let path = self.folder.join(file.file());
            let (begin, end) = (self.written[place], end.max(self.written[place]));
            OpenOptions::new()
                .create(true)
                .append(true)
                .open(&path)
                .and_then(|mut open| open.write_all(&bytes[begin as usize..end as usize]))
                .map_err(FleetError::io("append to", &path))?;
            self.written[place] = end;
        }
        Ok(())
    }
}

/// What the user gave is the reason.
fn unusable(error: impl std::fmt::Display) -> FleetError {
    FleetError::Input(error.to_string())
}

/// Where each record of a run begins, and the bytes of the store up to its surfaces.
fn needs(run: &Path, align: &[u8]) -> Result<Vec<(u64, u64)>, FleetError> {
    let path = run.join(Growing::Align.file());
    let wrong = |problem: String| FleetError::Input(format!("{}: {problem}", path.display()));
    let (mut chain, mut facts, mut needs) =
        (Chain::new(Growing::Align.kind()), RunFacts::default(), Vec::new());
    while let Some(part) = chain.step(&align[chain.len_bytes() as usize..], &path).map_err(unusable)? {
        part.payload.map_or(Ok(()), |payload| facts.take(part.version, payload)).map_err(wrong)?;
        needs.push((chain.len_bytes() - part.len as u64, facts.store_bytes()));
    }
    if !facts.is_ended {
        return Err(wrong(
            "the run has not ended, expected one that has; tessera resume goes on with it".into(),
        ));
    }
    let store = run.join(Growing::Store.file());
    let view = StoreView::open(&store).map_err(unusable)?;
    if let Some(spoilt) = facts.slots.iter().position(|slot| view.read(&journal_slot(slot)).is_err()) {
        let words = format!("{}: the surface of keyframe {spoilt} is damaged", store.display());
        return Err(FleetError::Input(words));
    }
    Ok(needs)
}
