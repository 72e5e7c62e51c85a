//! What is whole of a run's folder: every record and every surface is read, and nothing is changed.
//!
//! The folder may be a copy, one that a base of a fleet keeps, or that of a run that goes on.

use crate::error::ToolError;
use crate::export::read_settings;
use serde::Serialize;
use std::path::Path;
use tessera_journal::{Ending, Inspection, JournalError, StoreView, inspect, inspect_framing};
use tessera_messages::load_surface;
use tessera_slam::{AlignRecord, OptimiseRecord, StoreSlot};
use tessera_stage::{ALIGN_JOURNAL, OPTIMISE_JOURNAL, RunFile, RunFiles, journal_slot, slots};
use tessera_surface::Grid;

/// Surfaces in the form in which they travel, in a base's copy of a run.
const TRAVELLED: &str = "surfaces.journal";

/// State of one file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FileState {
    /// Every byte that a record accounts for is as it was written.
    Whole,
    /// It ends with bytes that were never a whole record, which no one needs.
    Torn,
    /// It has lost what was recorded.
    Damaged,
    /// It is not there, and the run needs it.
    Absent,
}

/// One file of a run.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct CheckedFile {
    /// Its name in the run's folder.
    pub name: String,
    /// Whether it is whole.
    pub state: FileState,
    /// What it holds; what is wrong with it, and where.
    pub detail: String,
}

/// All that a run rests on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verified {
    /// Whether nothing that was recorded is lost.
    pub is_whole: bool,
    /// File by file.
    pub files: Vec<CheckedFile>,
}

/// Reads everything of the run in `folder`.
///
/// # Errors
/// Where the folder is none of a run, or its settings cannot be read.
pub fn verify(folder: &Path) -> Result<Verified, ToolError> {
    let files = RunFiles::new(folder);
    let run = RunFile::read_recorded(&files)?;
    let settings = read_settings(&files)?;
    let grid = run.layout(&settings).grid;
    let mut checked = vec![
        whole(&files.run_file(), format!("run {}", run.name)),
        whole(&files.config(), "every setting".into()),
    ];
    let (mut n_frames, mut surfaces) = (0_u64, Vec::new());
    let take = |record: AlignRecord| {
        n_frames = u64::saturating_add(n_frames, matches!(record, AlignRecord::Frame(_)).into());
        surfaces.extend(slots(&record).map(|(id, slot)| (id, *slot)));
        Ok(())
    };
    let found = inspect(&files.align_journal(), ALIGN_JOURNAL, take);
    let holds = format!("{} and {}", count(n_frames, "frame"), count(surfaces.len() as u64, "keyframe"));
    checked.push(of_journal(&files.align_journal(), found, &holds));
    let found = inspect(&files.optimise_journal(), OPTIMISE_JOURNAL, |_: OptimiseRecord| Ok(()));
    checked.push(of_journal(&files.optimise_journal(), found, "corrections"));
    let travelled = folder.join(TRAVELLED);
    if files.store().exists() || !travelled.exists() {
        checked.push(of_store(&files.store(), grid, &surfaces));
    }
    if travelled.exists() {
        checked.push(of_journal(&travelled, inspect_framing(&travelled), "surfaces as they travel"));
    }
    for path in [files.align_checkpoint(), files.optimise_checkpoint()] {
        if path.exists() {
            checked.push(of_checkpoint(&path));
        }
    }
    let is_lost = |file: &CheckedFile| matches!(file.state, FileState::Damaged | FileState::Absent);
    Ok(Verified { is_whole: !checked.iter().any(is_lost), files: checked })
}

fn count(n: u64, what: &str) -> String {
    if n == 1 { format!("1 {what}") } else { format!("{n} {what}s") }
}

fn whole(path: &Path, detail: String) -> CheckedFile {
    file(path, FileState::Whole, detail)
}

fn file(path: &Path, state: FileState, detail: String) -> CheckedFile {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    CheckedFile { name, state, detail }
}

fn of_journal(path: &Path, found: Result<Inspection, JournalError>, holds: &str) -> CheckedFile {
    if !path.exists() {
        return file(path, FileState::Absent, "is not there".into());
    }
    let Inspection { n_records, whole_bytes, ending } = match found {
        Ok(found) => found,
        Err(error) => return file(path, FileState::Damaged, error.to_string()),
    };
    let records = count(n_records, "record");
    match ending {
        Ending::Whole => whole(path, format!("{records}: {holds}")),
        // A run's journals begin with a header, from before its first frame on.
        Ending::Torn { reason } if whole_bytes == 0 => file(path, FileState::Damaged, reason),
        Ending::Torn { reason } => {
            let rest = format!("{records}: {holds}; from byte {whole_bytes} on a torn end: {reason}");
            file(path, FileState::Torn, rest)
        }
        Ending::Damaged { reason, n_lost } => {
            let behind = count(n_lost, "whole record");
            let detail = format!("byte {whole_bytes}, behind {records}: {reason}; {behind} from there on");
            file(path, FileState::Damaged, detail)
        }
    }
}

/// Reads the surface of each keyframe.
fn of_store(path: &Path, grid: Grid, surfaces: &[(u32, StoreSlot)]) -> CheckedFile {
    if !path.exists() {
        let state = if surfaces.is_empty() { FileState::Whole } else { FileState::Absent };
        return file(path, state, "is not there".into());
    }
    let store = match StoreView::open_whole(path) {
        Ok(store) => store,
        Err(error) => return file(path, FileState::Damaged, error.to_string()),
    };
    let mut lost: Vec<String> = Vec::new();
    let mut n_evicted = 0_u64;
    for (id, slot) in surfaces {
        match store.read(&journal_slot(slot)) {
            Ok(None) => n_evicted = n_evicted.saturating_add(1),
            Ok(Some(bytes)) => {
                lost.extend(load_surface(grid, &bytes).err().map(|error| format!("keyframe {id}: {error}")));
            }
            Err(error) => lost.push(format!("keyframe {id}: {error}")),
        }
    }
    if let Some(first) = lost.first() {
        let n = count(lost.len() as u64, "surface");
        return file(path, FileState::Damaged, format!("{n} of {} lost; {first}", surfaces.len()));
    }
    let held = count((surfaces.len() as u64).saturating_sub(n_evicted), "surface");
    whole(path, if n_evicted > 0 { format!("{held}; {n_evicted} evicted") } else { held })
}

/// A checkpoint is a short cut: where it is not whole, its readers do without.
fn of_checkpoint(path: &Path) -> CheckedFile {
    match inspect_framing(path) {
        Ok(Inspection { ending: Ending::Whole, .. }) => {
            whole(path, "a short cut through the journals".into())
        }
        _ => file(path, FileState::Torn, "a short cut that is not whole: the journals are read".into()),
    }
}
