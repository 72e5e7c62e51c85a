//! Blocks of voxels near surfaces, and how views are fused into them.

use crate::block::{Block, SIDE};
use crate::extract;
use crate::integrate::IntegrateBlock;
use crate::mesh::Mesh;
use crate::settings::FusionSettings;
use crate::view::{PreparedView, View};
use rayon::prelude::*;
use std::collections::HashMap;

/// Why a map could not be fused.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum FusionError {
    /// The surfaces need more voxels than there may be.
    #[error(
        "the map needs more than {max_mb} MB at voxels of {voxel_mm} mm, \
         expected larger voxels or more memory"
    )]
    Memory {
        /// Most memory allowed, megabytes.
        max_mb: usize,
        /// Edge of a voxel, millimetres.
        voxel_mm: f64,
    },
}

/// Bytes that a block takes, its entry in the hash included.
const BLOCK_BYTES: usize = size_of::<Block>() + 32;

/// Views that are fused together: each block is taken up once for all of them.
pub const VIEWS_AT_ONCE: usize = 16;
/// A bit for each of them.
type ViewBits = u16;

/// A truncated signed distance field.
#[derive(Debug)]
pub struct Volume {
    settings: FusionSettings,
    index: HashMap<[i32; 3], u32>,
    /// Where each block is, in the order in which they came.
    places: Vec<[i32; 3]>,
    blocks: Vec<Box<Block>>,
}

impl Volume {
    /// An empty field.
    pub fn new(settings: &FusionSettings) -> Self {
        Self { settings: *settings, index: HashMap::new(), places: Vec::new(), blocks: Vec::new() }
    }

    /// Fuses more views in, in their order; [`VIEWS_AT_ONCE`] go through memory together.
    ///
    /// # Errors
    /// Where it would take more memory than allowed; of the views that went together with the one that did
    /// not fit nothing was fused, and the field holds some blocks that nothing was fused into.
    pub fn integrate(&mut self, views: &[View<'_>]) -> Result<(), FusionError> {
        views.chunks(VIEWS_AT_ONCE).try_for_each(|views| self.integrate_together(views))
    }

    fn integrate_together(&mut self, views: &[View<'_>]) -> Result<(), FusionError> {
        let prepare = |view| {
            let prepared = PreparedView::new(view, self.settings.max_depth_m);
            let places = self.places_near(&prepared);
            (prepared, places)
        };
        let (prepared, near): (Vec<PreparedView<'_>>, Vec<_>) = views.par_iter().map(prepare).unzip();
        let seen_by = self.touch(&near)?;
        let (voxel_m, truncation_m) = (self.settings.voxel_m as f32, self.truncation_m() as f32);
        let (places, arch) = (&self.places, self.settings.isa.arch());
        let blocks = self.blocks.par_iter_mut().zip(places).zip(&seen_by);
        blocks.filter(|(_, seen_by)| **seen_by != 0).for_each(|((block, place), seen_by)| {
            for (k, view) in prepared.iter().enumerate() {
                if seen_by >> k & 1 == 1 {
                    arch.dispatch(IntegrateBlock { view, block, place: *place, voxel_m, truncation_m });
                }
            }
        });
        Ok(())
    }

    /// The mesh at distance zero.
    pub fn mesh(&self) -> Mesh {
        extract::mesh(self, self.settings.min_triangles)
    }

    /// Memory that the voxels take, bytes.
    pub fn bytes(&self) -> usize {
        self.blocks.len() * BLOCK_BYTES
    }

    fn truncation_m(&self) -> f64 {
        self.settings.voxel_m * self.settings.truncation_voxels
    }

    /// Places of the blocks near a view's surface, some of them several times.
    fn places_near(&self, prepared: &PreparedView<'_>) -> Vec<[i32; 3]> {
        let edge_m = self.settings.voxel_m * f64::from(SIDE);
        let truncation_m = self.truncation_m();
        let n_steps = (2.0 * truncation_m / (0.5 * edge_m)).ceil() as i32;
        let mut places = Vec::new();
        // Neighbouring vertices mostly touch the same blocks: those of the vertex before are known.
        let mut known = vec![None; n_steps as usize + 1];
        for (point, normal) in prepared.points() {
            for step in 0..=n_steps {
                let along_m = truncation_m * (2.0 * f64::from(step) / f64::from(n_steps) - 1.0);
                let cell = ((point + normal * along_m) / edge_m).map(f64::floor);
                if !cell.iter().all(|c| c.abs() < f64::from(i32::MAX / SIDE)) {
                    continue;
                }
                let place = [cell.x as i32, cell.y as i32, cell.z as i32];
                if known[step as usize].replace(place) != Some(place) {
                    places.push(place);
                }
            }
        }
        places
    }

    /// Makes the blocks near the surfaces of views; for each block a bit for each view that it is near.
    fn touch(&mut self, near: &[Vec<[i32; 3]>]) -> Result<Vec<ViewBits>, FusionError> {
        let mut seen_by: Vec<ViewBits> = vec![0; self.blocks.len()];
        for (view, places) in near.iter().enumerate() {
            for place in places {
                let k = match self.index.get(place) {
                    Some(k) => *k as usize,
                    None => self.make(*place)?,
                };
                seen_by.resize(self.blocks.len(), 0);
                seen_by[k] |= 1 << view;
            }
        }
        Ok(seen_by)
    }

    fn make(&mut self, place: [i32; 3]) -> Result<usize, FusionError> {
        let k = self.blocks.len();
        if (k + 1) * BLOCK_BYTES > self.settings.max_bytes {
            let max_mb = self.settings.max_bytes / 1_000_000;
            return Err(FusionError::Memory { max_mb, voxel_mm: 1e3 * self.settings.voxel_m });
        }
        self.index.insert(place, k as u32);
        self.places.push(place);
        self.blocks.push(Box::new(Block::new()));
        Ok(k)
    }

    pub(crate) fn voxel_m(&self) -> f64 {
        self.settings.voxel_m
    }

    /// The 27 blocks around and in a place, by offset -1, 0, 1 along x, y and z.
    pub(crate) fn neighbourhood(&self, place: &[i32; 3]) -> [Option<&Block>; 27] {
        std::array::from_fn(|k| {
            let k = k as i32;
            let offset = [k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1];
            let place = [place[0] + offset[0], place[1] + offset[1], place[2] + offset[2]];
            self.index.get(&place).map(|k| &*self.blocks[*k as usize])
        })
    }

    /// Blocks in the order of their places, whatever the order in which they came.
    pub(crate) fn in_order(&self) -> Vec<[i32; 3]> {
        let mut places = self.places.clone();
        places.sort_unstable();
        places
    }
}
