//! Randomised ferns and the codes they make.

use super::thumbnail::{HEIGHT, Tile, WIDTH, shrink};
use tessera_numerics::SplitMix64;
use tessera_surface::SurfaceView;

/// Ferns of a code.
pub const N_FERNS: usize = 512;

/// The answers of all ferns, two ferns a byte.
pub type PlaceCode = Vec<u8>;

/// One tile and a threshold for each of depth, red, green and blue.
#[derive(Clone, Copy, Debug)]
struct Fern {
    tile: usize,
    depth_m: f32,
    rgb: [f32; 3],
}

/// The set of ferns, the same in every process and every run.
#[derive(Clone, Debug)]
pub struct Ferns(Vec<Fern>);

impl Default for Ferns {
    fn default() -> Self {
        let mut random = SplitMix64::for_frame(0x7e55_e7a0, 0);
        let mut between = |from: f32, to: f32| from + (to - from) * random.below(1 << 20) as f32 / 1048576.0;
        let fern = |_| Fern {
            tile: between(0.0, HEIGHT as f32) as usize * WIDTH + between(0.0, WIDTH as f32) as usize,
            depth_m: between(0.6, 4.0),
            rgb: [between(10.0, 245.0), between(10.0, 245.0), between(10.0, 245.0)],
        };
        Self((0..N_FERNS).map(fern).collect())
    }
}

impl Ferns {
    /// The code of a surface.
    pub fn code(&self, surface: &SurfaceView<'_>) -> PlaceCode {
        let tiles = shrink(surface);
        let answer = |fern: &Fern| {
            let tile: &Tile = &tiles[fern.tile];
            let bits = [
                tile.depth_m > fern.depth_m,
                tile.rgb[0] > fern.rgb[0],
                tile.rgb[1] > fern.rgb[1],
                tile.rgb[2] > fern.rgb[2],
            ];
            bits.iter().enumerate().map(|(k, bit)| u8::from(*bit) << k).sum::<u8>()
        };
        self.0.chunks_exact(2).map(|two| answer(&two[0]) | answer(&two[1]) << 4).collect()
    }
}

/// Share of ferns with the same answers, 0 to 1; 0 for codes of another length.
pub fn similarity(a: &[u8], b: &[u8]) -> f64 {
    if a.len() != b.len() || a.is_empty() {
        return 0.0;
    }
    let same: u32 = a
        .iter()
        .zip(b)
        .map(|(a, b)| {
            let differs = a ^ b;
            u32::from(differs & 0x0f == 0) + u32::from(differs & 0xf0 == 0)
        })
        .sum();
    f64::from(same) / (2 * a.len()) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_surface::{Grid, Vertex};

    /// A tilted wall with a stripe, seen from `x` metres to the side.
    fn surface(x: f32) -> (Grid, Vec<Vertex>) {
        let grid = Grid { width: 160, height: 120, step: 4 };
        let vertices = (0..grid.len())
            .map(|i| {
                let (r, c) = ((i / 160) as f32, (i % 160) as f32);
                let u = (c - 80.0) / 131.0;
                let z = 2.0 + u + 0.2 * x;
                let stripe = ((u * z + x) * 2.0) as i32 & 1;
                let rgb = if stripe == 0 { [200, 40, 90] } else { [30, 160, r as u8] };
                Vertex {
                    position: [u * z, (r - 60.0) / 131.0 * z, z],
                    flags_rgb: Vertex::pack(Vertex::VALID, 0, rgb),
                    normal: [0.0, 0.0, -1.0],
                    reserved: 0,
                }
            })
            .collect();
        (grid, vertices)
    }

    #[test]
    fn the_nearer_the_view_the_more_alike_the_code() {
        let ferns = Ferns::default();
        let code = |x| {
            let (grid, vertices) = surface(x);
            ferns.code(&SurfaceView { grid, vertices: &vertices })
        };
        let here = code(0.0);
        assert_eq!(here.len(), N_FERNS / 2);
        assert_eq!(similarity(&here, &here), 1.0);
        let (near, far) = (similarity(&here, &code(0.03)), similarity(&here, &code(0.8)));
        assert!(near > 0.8 && far < near - 0.2, "near {near}, far {far}");
        assert_eq!(similarity(&here, &[]), 0.0);
    }
}
