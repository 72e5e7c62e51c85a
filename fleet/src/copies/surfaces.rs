//! The surfaces of a run's active keyframes at the base, as they travelled, in the order in which they came.

use crate::error::FleetError;
use crate::wire::surfaces::from_wire;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Duration;
use tessera_journal::{Follower, Journal, OnDamage, Opening, RecordKind};
use tessera_surface::Grid;

/// Its name in the folder of a run at the base.
pub const SURFACES: &str = "surfaces.journal";
/// What it calls itself; surfaces in the forms before it were thinned through a range coder.
const KIND: RecordKind<TravelledSurface> = RecordKind::only("surfaces6", 16);
/// How long a base waits for one that is ending.
const WAIT: Duration = Duration::from_millis(500);

/// A surface that came.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TravelledSurface {
    /// Its keyframe.
    pub keyframe: u32,
    /// Its bytes ([`wire_form`](crate::wire::surfaces::wire_form)).
    pub bytes: Vec<u8>,
}

/// The surfaces that have come, each once.
pub struct SurfaceCopy {
    journal: Journal<TravelledSurface>,
    held: BTreeSet<u32>,
    surface_bytes: u64,
}

impl SurfaceCopy {
    /// Opens or creates the copy. What a death or a power cut took the end of is set aside: the robot is asked for it
    /// again.
    ///
    /// # Errors
    /// Where the file cannot be read or written.
    pub fn open(folder: &Path) -> Result<Self, FleetError> {
        let (mut held, mut surface_bytes) = (BTreeSet::new(), 0);
        let opening = Opening { on_damage: OnDamage::SetAside, ..Opening::new(WAIT) };
        let accept = |record: TravelledSurface| {
            held.insert(record.keyframe);
            surface_bytes = u64::saturating_add(surface_bytes, record.bytes.len() as u64);
            Ok(())
        };
        let (journal, _) = Journal::open_as(&folder.join(SURFACES), KIND, opening, accept)?;
        Ok(Self { journal, held, surface_bytes })
    }

    /// Whether the surface of a keyframe is here.
    pub fn has(&self, keyframe: u32) -> bool {
        self.held.contains(&keyframe)
    }

    /// Surfaces that are here: a map is made of the first so many of them.
    pub fn n_records(&self) -> u64 {
        self.held.len() as u64
    }

    /// Bytes of the file.
    pub fn len_bytes(&self) -> u64 {
        self.journal.mark().len_bytes()
    }

    /// Bytes of a surface, in the mean of those that came; 0 before the first.
    pub fn mean_bytes(&self) -> u64 {
        self.surface_bytes.checked_div(self.held.len() as u64).unwrap_or(0)
    }

    /// Appends surfaces that are not here yet and forces them to disk.
    ///
    /// # Errors
    /// Where the file cannot be written.
    pub fn append(&mut self, surfaces: &[TravelledSurface]) -> Result<(), FleetError> {
        let mut new: Vec<&TravelledSurface> = Vec::new();
        for surface in surfaces {
            let is_known = self.has(surface.keyframe) || new.iter().any(|n| n.keyframe == surface.keyframe);
            if !is_known {
                new.push(surface);
            }
        }
        for (place, surface) in (1..).zip(&new) {
            // Forced to disk with the last one.
            self.journal.append(surface, place == new.len())?;
            self.held.insert(surface.keyframe);
            self.surface_bytes = self.surface_bytes.saturating_add(surface.bytes.len() as u64);
        }
        Ok(())
    }
}

/// Whether bytes that came are a surface of this grid.
///
/// # Errors
/// Says what is wrong with them.
pub fn check_surface(grid: Grid, bytes: &[u8]) -> Result<(), String> {
    from_wire(grid, bytes).map(drop).map_err(|error| error.to_string())
}

/// The first `n` surfaces that came.
///
/// # Errors
/// Where they cannot be read or are not that many.
pub fn read_surfaces(folder: &Path, n: u64) -> Result<Vec<TravelledSurface>, FleetError> {
    let found = first_surfaces(folder, usize::try_from(n).unwrap_or(usize::MAX))?;
    if found.len() as u64 == n {
        return Ok(found);
    }
    let path = folder.join(SURFACES);
    Err(FleetError::Input(format!("{}: {} surfaces, expected {n}", path.display(), found.len())))
}

/// The first surfaces that came, `most` of them at most.
///
/// # Errors
/// Where they cannot be read.
pub fn first_surfaces(folder: &Path, most: usize) -> Result<Vec<TravelledSurface>, FleetError> {
    let mut found = Vec::new();
    if most > 0 {
        let mut follower = Follower::open(&folder.join(SURFACES), KIND)?;
        while found.len() < most
            && let Some(surface) = follower.next()?
        {
            found.push(surface);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_surface_is_here_once_and_a_torn_one_not_at_all() {
        let dir = tempfile::tempdir().unwrap();
        let surface = |keyframe| TravelledSurface { keyframe, bytes: vec![keyframe as u8; 100] };
        let mut copy = SurfaceCopy::open(dir.path()).unwrap();
        copy.append(&[surface(7), surface(3), surface(7)]).unwrap();
        copy.append(&[surface(3), surface(5)]).unwrap();
        assert_eq!((copy.n_records(), copy.mean_bytes()), (3, 100));
        let bytes = copy.len_bytes();
        drop(copy);
        let path = dir.path().join(SURFACES);
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(bytes - 1).unwrap();
        let copy = SurfaceCopy::open(dir.path()).unwrap();
        assert!(copy.has(7) && copy.has(3) && !copy.has(5));
        assert_eq!(read_surfaces(dir.path(), 2).unwrap(), [surface(7), surface(3)]);
        assert!(read_surfaces(dir.path(), 3).unwrap_err().to_string().contains("2 surfaces, expected 3"));
    }
}
