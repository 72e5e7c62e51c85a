//! A lattice of cells on the floor, in layers of height: which of them a ray goes through.

/// Layers below the band of heights in which something is an obstacle: where the floor is.
pub(crate) const N_FLOOR: usize = 2;
/// Height that layers have about, metres.
const LAYER_M: f64 = 0.1;
/// Cells from the origin at most, to each side.
const MOST_CELLS: f64 = 4096.0;

/// Cells of one edge; layers of equal height that fill a band, and two more below it.
#[derive(Clone, Copy, Debug)]
pub struct CellLattice {
    /// Edge of a cell, metres.
    pub cell_m: f64,
    layer_m: f64,
    bottom_m: f64,
    /// Number of layers, those of the floor included.
    pub n_layers: usize,
}

impl CellLattice {
    /// Cells of that edge; obstacles have heights from `low_m` up to `high_m`.
    pub fn new(cell_m: f64, (low_m, high_m): (f64, f64)) -> Self {
        let n_band = ((high_m - low_m) / LAYER_M).round().max(1.0);
        let layer_m = (high_m - low_m) / n_band;
        let bottom_m = low_m - N_FLOOR as f64 * layer_m;
        Self { cell_m, layer_m, bottom_m, n_layers: n_band as usize + N_FLOOR }
    }

    /// A point in units of cells and layers; `None` where it is too far away.
    pub fn place(&self, [x, y, z]: [f64; 3]) -> Option<[f64; 3]> {
        let place = [x / self.cell_m, y / self.cell_m, (z - self.bottom_m) / self.layer_m];
        place.iter().all(|units| units.abs() < MOST_CELLS).then_some(place)
    }

    /// The layer of a height in units; `None` above and below all.
    pub fn layer(&self, height: i32) -> Option<usize> {
        usize::try_from(height).ok().filter(|layer| *layer < self.n_layers)
    }
}

/// Visits the boxes of unit edge that the way between two places goes through, the last one left out
/// (Amanatides and Woo, "A Fast Voxel Traversal Algorithm for Ray Tracing", Eurographics 1987).
pub(crate) fn traverse(from: [f64; 3], to: [f64; 3], mut visit: impl FnMut([i32; 3])) {
    let mut at = from.map(|units| units.floor() as i32);
    let end = to.map(|units| units.floor() as i32);
    let step = [0, 1, 2].map(|axis: usize| (end[axis] - at[axis]).signum());
    // Share of the way from border to border along each axis, and at which the next one is crossed.
    let share = [0, 1, 2].map(|axis: usize| (to[axis] - from[axis]).abs().recip());
    let mut next = [0, 1, 2].map(|axis: usize| match step[axis] {
        0 => f64::INFINITY,
        1 => (f64::from(at[axis] + 1) - from[axis]) * share[axis],
        _ => (from[axis] - f64::from(at[axis])) * share[axis],
    });
    while at != end {
        visit(at);
        let flat = usize::from(next[1] < next[0]);
        let axis = if next[2] < next[flat] { 2 } else { flat };
        at[axis] += step[axis];
        // Beyond the end there is no border, whatever rounding says.
        next[axis] = if at[axis] == end[axis] { f64::INFINITY } else { next[axis] + share[axis] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way(from: [f64; 3], to: [f64; 3]) -> Vec<[i32; 3]> {
        let mut boxes = Vec::new();
        traverse(from, to, |at| boxes.push(at));
        boxes
    }

    #[test]
    fn a_ray_goes_from_box_to_neighbouring_box() {
        assert_eq!(way([0.5, 0.5, 0.5], [2.5, 0.5, 0.5]), [[0, 0, 0], [1, 0, 0]]);
        assert_eq!(way([0.1, 0.9, 0.0], [-1.5, 0.9, 0.0]), [[0, 0, 0], [-1, 0, 0]]);
        assert_eq!(way([0.2, 0.3, 0.1], [0.9, 0.8, 0.7]), [[0; 3]; 0]);
        assert_eq!(way([0.2, 0.9, 0.5], [1.1, 1.9, 0.5]), [[0, 0, 0], [0, 1, 0]]);
        for to in [[7.3, -4.2, 1.9], [-3.0, 5.0, -2.0], [1.0, 1.0, 1.0], [4.0, 4.0, 4.0]] {
            let from = [0.5, 0.25, 1.0];
            let boxes = way(from, to);
            let n = (0..3).map(|k| (to[k].floor() - from[k].floor()).abs() as usize).sum::<usize>();
            assert_eq!(boxes.len(), n, "{to:?}");
            let apart = |pair: &[[i32; 3]]| (0..3).map(|k| (pair[1][k] - pair[0][k]).abs()).sum::<i32>();
            assert!(boxes.windows(2).all(|pair| apart(pair) == 1), "{boxes:?}");
        }
    }

    #[test]
    fn layers_fill_the_band_and_lie_below_it() {
        let lattice = CellLattice::new(0.05, (0.1, 1.0));
        assert_eq!(lattice.n_layers, 9 + N_FLOOR);
        let layer = |z| lattice.layer(lattice.place([0.0, 0.0, z]).unwrap()[2].floor() as i32);
        assert_eq!((layer(-0.11), layer(-0.05), layer(0.05)), (None, Some(0), Some(1)));
        assert_eq!((layer(0.11), layer(0.99), layer(1.01)), (Some(2), Some(10), None));
        assert_eq!(lattice.place([1e9, 0.0, 0.0]), None);
        assert_eq!(lattice.place([f64::NAN, 0.0, 0.0]), None);
    }
}
