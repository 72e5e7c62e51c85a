//! Query points from two distributions: over the image, and over normal directions (SPEC 10.1).

use crate::random::SplitMix64;
use crate::settings::RegistrationSettings;
use tessera_surface::{SurfaceView, Vertex};

/// One query point: a copy of its vertex and where it was in the grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Point in the camera frame as exposed, metres.
    pub point: [f32; 3],
    /// Unit normal in the camera frame.
    pub normal: [f32; 3],
    /// Brightness in `[0, 1]`.
    pub intensity: f32,
    /// Row of the grid.
    pub grid_row: u16,
}

/// Draws samples; holds its buffers.
#[derive(Debug, Default)]
pub struct Sampler {
    candidates: Vec<u32>,
    bins: Vec<Vec<u32>>,
    drawn: Vec<u32>,
}

/// Cells of normal space: polar bands (towards the camera is the pole) times azimuth sectors.
const POLAR: usize = 6;
const AZIMUTH: usize = 12;

impl Sampler {
    /// Draws the samples of the frame with this index, in raster order: neighbours in the list are
    /// neighbours in the image, so a search goes through the target's memory once. Vertices at
    /// depth edges and far points take no part (TRAPS 65).
    pub fn draw(
        &mut self,
        surface: &SurfaceView<'_>,
        index: u64,
        settings: &RegistrationSettings,
        out: &mut Vec<Sample>,
    ) {
        let mut random = SplitMix64::for_frame(settings.seed, index);
        self.choose(surface.vertices, settings);
        out.clear();
        self.drawn.clear();
        let n_uniform = (settings.uniform_samples as usize).min(self.candidates.len());
        // One draw from each of n equal runs of the raster order: uniform, without clumps.
        for k in 0..n_uniform {
            let (from, to) =
                (k * self.candidates.len() / n_uniform, (k + 1) * self.candidates.len() / n_uniform);
            self.drawn.push(self.candidates[from + random.below(to - from)]);
        }
        let mut wanted = settings.normal_space_samples as usize;
        while wanted > 0 {
            let before = wanted;
            for bin in self.bins.iter_mut().filter(|bin| !bin.is_empty()) {
                if wanted == 0 {
                    break;
                }
                let pick = random.below(bin.len());
                self.drawn.push(bin.swap_remove(pick));
                wanted -= 1;
            }
            if wanted == before {
                break;
            }
        }
        self.drawn.sort_unstable();
        let width = surface.grid.width;
        out.extend(self.drawn.iter().map(|&i| {
            let v = &surface.vertices[i as usize];
            let grid_row = (i as usize / width) as u16;
            Sample { point: v.position, normal: v.normal, intensity: v.intensity, grid_row }
        }));
    }

    /// All vertices that may be drawn, and those of each bin of normal space: one way through the
    /// surface for both.
    fn choose(&mut self, vertices: &[Vertex], settings: &RegistrationSettings) {
        self.candidates.clear();
        self.bins.resize_with(POLAR * AZIMUTH, Vec::new);
        self.bins.iter_mut().for_each(Vec::clear);
        let with_bins = settings.normal_space_samples > 0;
        for (i, vertex) in vertices.iter().enumerate() {
            if vertex.is_inner() && vertex.position[2] <= settings.max_sample_depth_m {
                self.candidates.push(i as u32);
                if with_bins {
                    self.bins[bin_of(&vertex.normal)].push(i as u32);
                }
            }
        }
    }
}

/// The bin of a unit normal: equal bands of `n_z`, and azimuth by comparing slopes rather than by
/// an arc tangent, which costs more than the whole rest.
fn bin_of(n: &[f32; 3]) -> usize {
    let polar = (((1.0 + n[2]) * (POLAR as f32)) as usize).min(POLAR - 1);
    let (x, y) = (n[0].abs(), n[1].abs());
    // tan(30 deg) and tan(60 deg) cut each quadrant in three.
    let third = usize::from(y > 0.577_350_26 * x) + usize::from(y > 1.732_050_8 * x);
    let quadrant = usize::from(n[0] < 0.0) + 2 * usize::from(n[1] < 0.0);
    polar * AZIMUTH + quadrant * 3 + third
}
