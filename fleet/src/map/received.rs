//! What a map is made of the surfaces of one run: the robot's whole store, or those surfaces that came.

use crate::copies::surfaces::{TravelledSurface, read_surfaces};
use crate::error::FleetError;
use crate::wire::surfaces::from_wire;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;
use tessera_features::Feature;
use tessera_slam::{AlignRecord, KeyframeState, KeyframeSurfaces, RetiredRecord, TrackerState};
use tessera_stage::StoredKeyframes;
use tessera_surface::{Grid, Vertex};

/// The surfaces of a run's keyframes.
pub(crate) enum RunSurfaces {
    /// All, as the robot has them.
    Whole(StoredKeyframes),
    /// Those that came.
    Received(ReceivedSurfaces),
}

impl RunSurfaces {
    /// Takes in the keyframes that a record brings.
    pub(crate) fn take_unread(&mut self, record: &AlignRecord) -> Result<(), FleetError> {
        match self {
            Self::Whole(stored) => Ok(stored.take_unread(record)?),
            Self::Received(_) => Ok(()),
        }
    }

    /// Leaves those of the active keyframes alone: which others came is a matter of time.
    pub(crate) fn keep_active(&mut self, keyframes: &[KeyframeState]) {
        if let Self::Received(received) = self {
            let is_active = |id: &u32| keyframes.get(*id as usize).is_some_and(KeyframeState::is_active);
            received.surfaces.retain(|id, _| is_active(id));
        }
    }

    /// Retires the active keyframes of a run whose surfaces have not come: each moves along with the nearest
    /// one of its component whose surface is here, or else with the first of its component.
    pub(crate) fn retire_missing(&self, state: &mut TrackerState) {
        let Self::Received(received) = self else { return };
        let active = state.keyframes.iter().filter(|k| k.is_active());
        let mut components: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        active.for_each(|k| components.entry(state.submaps.component(k.submap)).or_default().push(k.id));
        for ids in components.into_values() {
            let here: Vec<u32> =
                ids.iter().copied().filter(|id| received.surfaces.contains_key(id)).collect();
            let nearest = |id: u32| here.iter().copied().min_by_key(|other| (other.abs_diff(id), *other));
            for keyframe in ids.iter().copied().filter(|id| here.binary_search(id).is_err()) {
                let first = ids.first().copied();
                let anchored_to = nearest(keyframe).or(first).unwrap_or(keyframe);
                if anchored_to != keyframe {
                    state.retire(&RetiredRecord { keyframe, anchored_to });
                }
            }
        }
    }

    /// Whether every surface that was read so far was whole.
    pub(crate) fn check(&mut self) -> Result<(), FleetError> {
        match self {
            Self::Whole(stored) => Ok(stored.check()?),
            Self::Received(received) => received.damage.take().map_or(Ok(()), Err),
        }
    }

    /// Whether every keyframe that was read so far had a surface.
    pub(crate) fn check_held(&self) -> Result<(), FleetError> {
        match self {
            Self::Whole(stored) => Ok(stored.check_held()?),
            Self::Received(received) => received.missing.get().map_or(Ok(()), |id| {
                Err(FleetError::Input(format!("the surface of keyframe {id} is needed and not here")))
            }),
        }
    }

    /// The surfaces themselves.
    pub(crate) fn of_keyframes(&self) -> &dyn KeyframeSurfaces {
        match self {
            Self::Whole(stored) => stored,
            Self::Received(received) => received,
        }
    }
}

/// A surface as it came, and unpacked once it is read.
struct HeldSurface {
    bytes: Vec<u8>,
    unpacked: OnceLock<Option<(Vec<Vertex>, Vec<Feature>)>>,
}

/// Surfaces that came.
pub(crate) struct ReceivedSurfaces {
    grid: Grid,
    /// By keyframe.
    surfaces: BTreeMap<u32, HeldSurface>,
    blank: OnceLock<Vec<Vertex>>,
    /// The first that was read and is not here.
    missing: OnceLock<u32>,
    damage: OnceLock<FleetError>,
}

impl ReceivedSurfaces {
    /// The first `n` that came.
    pub(crate) fn read(folder: &Path, n: u64, grid: Grid) -> Result<Self, FleetError> {
        let surface = |TravelledSurface { keyframe, bytes }| {
            (keyframe, HeldSurface { bytes, unpacked: OnceLock::new() })
        };
        let surfaces = read_surfaces(folder, n)?.into_iter().map(surface).collect();
        let (blank, missing, damage) = Default::default();
        Ok(Self { grid, surfaces, blank, missing, damage })
    }

    fn surface(&self, keyframe: u32) -> Option<&(Vec<Vertex>, Vec<Feature>)> {
        let Some(surface) = self.surfaces.get(&keyframe) else {
            self.missing.get_or_init(|| keyframe);
            return None;
        };
        let unpack = || {
            let unpacked = from_wire(self.grid, &surface.bytes);
            let words = |error| FleetError::Input(format!("the surface of keyframe {keyframe}: {error}"));
            unpacked.map_err(|error| self.damage.set(words(error))).ok()
        };
        surface.unpacked.get_or_init(unpack).as_ref()
    }
}

impl KeyframeSurfaces for ReceivedSurfaces {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        match self.surface(keyframe) {
            Some((vertices, _)) => vertices,
            None => self.blank.get_or_init(|| vec![Vertex::default(); self.grid.len()]),
        }
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        self.surface(keyframe).map_or(&[], |(_, features)| features)
    }
}
