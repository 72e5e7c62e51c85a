//! Query points from two distributions: over the image, and over normal directions (method 10.1).

mod candidates;

use crate::settings::RegistrationSettings;
use candidates::{BINS, Candidates};
use tessera_numerics::SplitMix64;
use tessera_surface::SurfaceView;

/// One query point: a copy of its vertex and where it was in the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Point in the camera frame as exposed, metres.
    pub point: [f32; 3],
    /// Unit normal in the camera frame.
    pub normal: [f32; 3],
    /// Row of the grid.
    pub grid_row: u16,
}

/// Depth beyond which no point is sampled, metres: noise grows with the square of the depth.
const MAX_SAMPLE_DEPTH_M: f32 = 5.0;

/// Draws samples; holds its buffers.
#[derive(Debug, Default)]
pub struct Sampler {
    candidates: Candidates,
    /// A bit for each vertex: drawn over the image, drawn over normal directions.
    over_image: Vec<u64>,
    over_normals: Vec<u64>,
    drawn: Vec<u32>,
}

impl Sampler {
    /// Draws the samples of the frame with this index, in raster order: neighbours in the list are
    /// neighbours in the image, so a search goes through the target's memory once. Vertices at
    /// depth edges and far points take no part (method T65).
    pub fn draw(
        &mut self,
        surface: &SurfaceView<'_>,
        index: u64,
        settings: &RegistrationSettings,
        out: &mut Vec<Sample>,
    ) {
        self.choose(surface, index, settings);
        gather(surface, &self.drawn, out);
    }

    /// The vertices that [`Self::draw`] takes: in raster order, those of both distributions twice.
    pub fn choose(
        &mut self,
        surface: &SurfaceView<'_>,
        index: u64,
        settings: &RegistrationSettings,
    ) -> &[u32] {
        let mut random = SplitMix64::for_frame(settings.seed, index);
        self.candidates.find(surface.vertices, MAX_SAMPLE_DEPTH_M);
        let candidates = self.candidates.in_raster_order();
        for drawn in [&mut self.over_image, &mut self.over_normals] {
            drawn.clear();
            drawn.resize(surface.vertices.len().div_ceil(BITS), 0);
        }
        let n_uniform = (settings.uniform_samples as usize).min(candidates.len());
        // One draw from each of n equal runs of the raster order: uniform, without clumps.
        for k in 0..n_uniform {
            let (from, to) = (k * candidates.len() / n_uniform, (k + 1) * candidates.len() / n_uniform);
            mark(&mut self.over_image, candidates[from + random.below(to - from)]);
        }
        let mut wanted = (settings.normal_space_samples as usize).min(candidates.len());
        if wanted > 0 {
            self.candidates.sort_by_bin();
        }
        while wanted > 0 {
            for bin in 0..BINS {
                let left = self.candidates.left(bin);
                if left > 0 && wanted > 0 {
                    mark(&mut self.over_normals, self.candidates.take(bin, random.below(left)));
                    wanted -= 1;
                }
            }
        }
        self.drawn.clear();
        for (word, (&one, &other)) in self.over_image.iter().zip(&self.over_normals).enumerate() {
            let mut rest = one | other;
            while rest != 0 {
                let bit = rest.trailing_zeros();
                rest &= rest - 1;
                let n_times = (one >> bit & 1) + (other >> bit & 1);
                let vertex = (word * BITS) as u32 + bit;
                (0..n_times).for_each(|_| self.drawn.push(vertex));
            }
        }
        &self.drawn
    }
}

/// The samples at these vertices, in their order.
pub fn gather(surface: &SurfaceView<'_>, vertices: &[u32], out: &mut Vec<Sample>) {
    out.clear();
    out.extend(vertices.iter().map(|&i| {
        let v = &surface.vertices[i as usize];
        let grid_row = (i as usize / surface.grid.width) as u16;
        Sample { point: v.position, normal: v.normal, grid_row }
    }));
}

/// Bits of a word.
const BITS: usize = u64::BITS as usize;

fn mark(drawn: &mut [u64], vertex: u32) {
    drawn[vertex as usize / BITS] |= 1 << (vertex as usize % BITS);
}
