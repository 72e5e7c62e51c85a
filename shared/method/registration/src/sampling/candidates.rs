//! Candidate vertices for sampling, and those of each bin of normal space.

use std::ops::Range;
use tessera_surface::Vertex;

/// Bins of normal space: polar bands (towards the camera is the pole) times azimuth sectors.
pub(crate) const BINS: usize = POLAR * AZIMUTH;
const POLAR: usize = 6;
const AZIMUTH: usize = 12;

/// Bins of a run are counted apart: neighbours mostly share a bin, and each would wait for the count
/// of the one before it.
const RUNS: usize = 4;

/// A count for each run and bin. More bins than there are: a byte is always one of them.
type Counts = [[u32; 1 << u8::BITS]; RUNS];

/// The vertices of one surface that may be drawn; holds its buffers.
#[derive(Debug, Default)]
pub(crate) struct Candidates {
    /// Vertices that may be drawn in raster order, and the bin of each: the first `n` places.
    vertices: Vec<u32>,
    bins: Vec<u8>,
    n: usize,
    /// The same sorted by bin, and for each bin the first of its places and how many are left.
    by_bin: Vec<u32>,
    left: Vec<(u32, u32)>,
}

impl Candidates {
    /// Finds the inner vertices that are not too deep.
    pub(crate) fn find(&mut self, vertices: &[Vertex], max_depth_m: f32) {
        self.vertices.resize(vertices.len(), 0);
        self.bins.resize(vertices.len(), 0);
        self.n = 0;
        // Without a branch: each is put down, and overwritten by the next one unless it counts.
        for (i, vertex) in vertices.iter().enumerate() {
            self.vertices[self.n] = i as u32;
            self.bins[self.n] = bin_of(&vertex.normal);
            self.n += usize::from(vertex.is_inner() & (vertex.position[2] <= max_depth_m));
        }
    }

    /// All of them in raster order.
    pub(crate) fn in_raster_order(&self) -> &[u32] {
        &self.vertices[..self.n]
    }

    /// Sorts them by bin, each bin in raster order.
    pub(crate) fn sort_by_bin(&mut self) {
        let mut next: Counts = [[0; 1 << u8::BITS]; RUNS];
        for_each(self.n, |run, at| next[run][usize::from(self.bins[at])] += 1);
        self.left.clear();
        let mut at = 0;
        for bin in 0..BINS {
            let first = at;
            for run in &mut next {
                (run[bin], at) = (at, at + run[bin]);
            }
            self.left.push((first, at - first));
        }
        self.by_bin.resize(self.n, 0);
        for_each(self.n, |run, at| {
            let place = &mut next[run][usize::from(self.bins[at])];
            self.by_bin[*place as usize] = self.vertices[at];
            *place += 1;
        });
    }

    /// How many of a bin have not been taken.
    pub(crate) fn left(&self, bin: usize) -> usize {
        self.left[bin].1 as usize
    }

    /// Takes one of those left in a bin; the last of them gets its place.
    pub(crate) fn take(&mut self, bin: usize, pick: usize) -> u32 {
        let (first, left) = &mut self.left[bin];
        let own = &mut self.by_bin[*first as usize..(*first + *left) as usize];
        *left -= 1;
        let taken = own[pick];
        own[pick] = own[*left as usize];
        taken
    }
}

/// Calls with each of `n` places and its run: the runs in turn, each in rising order.
#[inline(always)]
fn for_each(n: usize, mut call: impl FnMut(usize, usize)) {
    let length = n / RUNS;
    for k in 0..length {
        for run in 0..RUNS {
            call(run, run * length + k);
        }
    }
    let rest: Range<usize> = RUNS * length..n;
    rest.for_each(|at| call(RUNS - 1, at));
}

/// The bin of a unit normal: equal bands of `n_z`, and azimuth by comparing slopes rather than by
/// an arc tangent, which costs more than the whole rest.
#[inline(always)]
fn bin_of(n: &[f32; 3]) -> u8 {
    let polar = (((1.0 + n[2]) * (POLAR as f32)) as u8).min(POLAR as u8 - 1);
    let (x, y) = (n[0].abs(), n[1].abs());
    // tan(30 deg) and tan(60 deg) cut each quadrant in three.
    let third = u8::from(y > 0.577_350_26 * x) + u8::from(y > 1.732_050_8 * x);
    let quadrant = u8::from(n[0] < 0.0) + 2 * u8::from(n[1] < 0.0);
    polar * AZIMUTH as u8 + quadrant * 3 + third
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    #[test]
    fn each_bin_holds_its_vertices_in_raster_order_until_they_are_taken() {
        let mut random = SplitMix64::for_frame(5, 0);
        let mut uniform = || random.next_u64() as f32 / u64::MAX as f32 * 2.0 - 1.0;
        for n in [0, 1, 3, 4, 5, 1001] {
            let vertices: Vec<Vertex> = (0..n)
                .map(|_| {
                    let flags = if uniform() > 0.5 { Vertex::BOUNDARY } else { 0 } | Vertex::VALID;
                    let normal = [uniform(), uniform(), uniform()];
                    let length = normal.iter().map(|c| c * c).sum::<f32>().sqrt();
                    Vertex {
                        position: [0.0, 0.0, 3.0 + 2.5 * uniform()],
                        normal: normal.map(|c| c / length),
                        flags_rgb: Vertex::pack(flags, 0, [0; 3]),
                        ..Vertex::default()
                    }
                })
                .collect();
            let mut found = Candidates::default();
            found.find(&vertices, 5.0);
            let expected: Vec<u32> = (0..n as u32)
                .filter(|&i| vertices[i as usize].is_inner() && vertices[i as usize].position[2] <= 5.0)
                .collect();
            assert_eq!(found.in_raster_order(), expected);
            found.sort_by_bin();
            let mut n_taken = 0;
            for bin in 0..BINS {
                let mut own = expected.clone();
                own.retain(|&i| usize::from(bin_of(&vertices[i as usize].normal)) == bin);
                while found.left(bin) > 0 {
                    assert_eq!(found.left(bin), own.len());
                    let pick = own.len() / 3;
                    assert_eq!(found.take(bin, pick), own.swap_remove(pick));
                    n_taken += 1;
                }
                assert!(own.is_empty());
            }
            assert_eq!(n_taken, expected.len());
        }
    }
}
