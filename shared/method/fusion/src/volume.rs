//! Blocks of voxels near surfaces, and how views are fused into them.

use crate::block::{Block, N, SIDE, Voxel};
use crate::extract;
use crate::mesh::Mesh;
use crate::settings::FusionSettings;
use crate::view::{PreparedView, SeenPoint, View};
use nalgebra::Vector3;
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
/// Depth below which certainty does not grow any more, metres.
const NEAREST_M: f32 = 0.4;

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

    /// Fuses one more view in.
    ///
    /// # Errors
    /// Where it would take more memory than allowed; the field then holds what it held before,
    /// and some blocks that nothing was fused into.
    pub fn integrate(&mut self, view: &View<'_>) -> Result<(), FusionError> {
        let prepared = PreparedView::new(view, self.settings.max_depth_m);
        let touched = self.touch(&prepared)?;
        let (voxel_m, truncation_m) = (self.settings.voxel_m as f32, self.truncation_m() as f32);
        let places = &self.places;
        self.blocks.par_iter_mut().enumerate().filter(|(k, _)| touched[*k]).for_each(|(k, block)| {
            for (line, voxels) in block.chunks_exact_mut(SIDE as usize).enumerate() {
                let first = centre(&places[k], line * SIDE as usize, voxel_m);
                let line: [_; SIDE as usize] = prepared.project_line(&first, voxel_m);
                for (voxel, at) in voxels.iter_mut().zip(line) {
                    if let Some(seen) = prepared.look(&at, -truncation_m) {
                        add(voxel, &prepared, &seen, truncation_m);
                    }
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

    /// Makes the blocks near the view's surface; says of each block whether it is one of them.
    fn touch(&mut self, prepared: &PreparedView<'_>) -> Result<Vec<bool>, FusionError> {
        let edge_m = self.settings.voxel_m * f64::from(SIDE);
        let truncation_m = self.truncation_m();
        let n_steps = (2.0 * truncation_m / (0.5 * edge_m)).ceil() as i32;
        let mut touched = vec![false; self.blocks.len()];
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
                if known[step as usize].replace(place) == Some(place) {
                    continue;
                }
                let k = match self.index.get(&place) {
                    Some(k) => *k as usize,
                    None => self.make(place)?,
                };
                touched.resize(self.blocks.len(), false);
                touched[k] = true;
            }
        }
        Ok(touched)
    }

    fn make(&mut self, place: [i32; 3]) -> Result<usize, FusionError> {
        let k = self.blocks.len();
        if (k + 1) * BLOCK_BYTES > self.settings.max_bytes {
            let max_mb = self.settings.max_bytes / 1_000_000;
            return Err(FusionError::Memory { max_mb, voxel_mm: 1e3 * self.settings.voxel_m });
        }
        self.index.insert(place, k as u32);
        self.places.push(place);
        self.blocks.push(Box::new([Voxel::default(); N]));
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

/// Takes what a view saw of a voxel in.
#[inline]
fn add(voxel: &mut Voxel, view: &PreparedView<'_>, seen: &SeenPoint, truncation_m: f32) {
    let distance = seen.distance_m / truncation_m;
    // Depth is less certain with the square of itself.
    let near = NEAREST_M / seen.depth_m.max(NEAREST_M);
    let weight = seen.cosine * near * near * near * near;
    voxel.add_distance(distance.min(1.0), weight);
    if distance.abs() < 0.5 {
        voxel.add_colour(view.colour(seen), weight);
    }
}

/// Centre of a voxel in the world, metres.
fn centre(place: &[i32; 3], at: usize, voxel_m: f32) -> Vector3<f32> {
    let at = at as i32;
    let local = [at % SIDE, at / SIDE % SIDE, at / (SIDE * SIDE)];
    Vector3::from_fn(|axis, _| ((place[axis] * SIDE + local[axis]) as f32 + 0.5) * voxel_m)
}
