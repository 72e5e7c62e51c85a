//! What one keyframe says of the boxes of a lattice: seen through, or with something in them.

use crate::lattice::{CellLattice, N_FLOOR, traverse};
use crate::points::ColouredPoint;
use std::collections::HashSet;
use tessera_geometry::Pose;

/// Points farther than this from the camera say nothing, metres.
const MOST_RANGE_M: f64 = 10.0;
/// Cells before what was hit that a ray does not free: at a grazing angle it passes through cells of
/// the same wall that happen to have no point.
const SPARED_CELLS: f64 = 1.5;

/// A keyframe's word on a box.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CellEvidence {
    /// Nothing.
    None,
    /// It was seen through, or it is floor.
    Free,
    /// There is something in it.
    Hit,
}

/// The words of one keyframe, in a rectangle of cells.
pub struct RayScan {
    begin: [i32; 2],
    width: usize,
    n_layers: usize,
    words: Vec<CellEvidence>,
}

impl RayScan {
    /// Casts a ray from the camera to each point, metres in the frame of the lattice.
    pub fn cast(lattice: &CellLattice, camera: [f64; 3], points: impl Iterator<Item = [f64; 3]>) -> Self {
        let Some(from) = lattice.place(camera) else { return Self::new(lattice, [0.0; 3], &[]) };
        let range_m = |p: &[f64; 3]| (0..3).map(|axis| (p[axis] - camera[axis]).powi(2)).sum::<f64>().sqrt();
        let near =
            points.map(|point| (range_m(&point), point)).filter(|(range_m, _)| *range_m <= MOST_RANGE_M);
        let ends: Vec<(f64, [f64; 3])> =
            near.filter_map(|(range_m, point)| Some((range_m, lattice.place(point)?))).collect();
        let mut scan = Self::new(lattice, from, &ends);
        let mut reached = HashSet::new();
        for (range_m, to) in ends {
            let end = to.map(|units| units.floor() as i32);
            // Another ray into the same box says the same.
            if !reached.insert(end) {
                continue;
            }
            if end[2] < N_FLOOR as i32 {
                traverse(from, to, |at| scan.mark(lattice, at, CellEvidence::Free));
                scan.mark(lattice, end, CellEvidence::Free);
                continue;
            }
            let share = (1.0 - SPARED_CELLS * lattice.cell_m / range_m).max(0.0);
            let before = [0, 1, 2].map(|axis| from[axis] + share * (to[axis] - from[axis]));
            traverse(from, before, |at| scan.mark(lattice, at, CellEvidence::Free));
            scan.mark(lattice, end, CellEvidence::Hit);
        }
        scan
    }

    /// As [`Self::cast`], of a keyframe's points in its camera's axes.
    pub fn of_keyframe<'p>(
        lattice: &CellLattice,
        map_from_camera: &Pose,
        points: impl Iterator<Item = &'p ColouredPoint>,
    ) -> Self {
        let in_map = points.map(|point| point.moved(map_from_camera).position.map(f64::from));
        Self::cast(lattice, map_from_camera.translation.vector.into(), in_map)
    }

    /// Nothing said, with room for rays from one place to these.
    fn new(lattice: &CellLattice, from: [f64; 3], ends: &[(f64, [f64; 3])]) -> Self {
        let range = |axis: usize| {
            let own = from[axis].floor() as i32;
            let cells = || ends.iter().map(|(_, place)| place[axis].floor() as i32);
            (cells().fold(own, i32::min), cells().fold(own, i32::max))
        };
        let ((left, right), (near, far)) = (range(0), range(1));
        let (width, height) = ((right - left + 1) as usize, (far - near + 1) as usize);
        let words = vec![CellEvidence::None; width * height * lattice.n_layers];
        Self { begin: [left, near], width, n_layers: lattice.n_layers, words }
    }

    /// Something in a box counts more than a ray through another part of it.
    fn mark(&mut self, lattice: &CellLattice, [x, y, height]: [i32; 3], word: CellEvidence) {
        let Some(layer) = lattice.layer(height) else { return };
        let cell = (y - self.begin[1]) as usize * self.width + (x - self.begin[0]) as usize;
        let place = &mut self.words[cell * self.n_layers + layer];
        if *place != CellEvidence::Hit {
            *place = word;
        }
    }

    /// Cells with the words on their layers, from the floor up; those without any word are left out.
    pub fn cells(&self) -> impl Iterator<Item = ([i32; 2], &[CellEvidence])> {
        let said = self.words.chunks(self.n_layers).enumerate();
        let said = said.filter(|(_, words)| words.iter().any(|word| *word != CellEvidence::None));
        said.map(|(cell, words)| {
            let (x, y) = (cell % self.width, cell / self.width);
            ([self.begin[0] + x as i32, self.begin[1] + y as i32], words)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The camera is 0.75 m above the floor; the band is 0.1 to 1 m.
    fn words(points: &[[f64; 3]]) -> Vec<([i32; 2], String)> {
        let lattice = CellLattice::new(0.5, (0.1, 1.0));
        let scan = RayScan::cast(&lattice, [0.25, 0.25, 0.75], points.iter().copied());
        let letter = |word: &CellEvidence| match word {
            CellEvidence::None => '.',
            CellEvidence::Free => 'f',
            CellEvidence::Hit => 'H',
        };
        scan.cells().map(|(cell, words)| (cell, words.iter().map(letter).collect())).collect()
    }

    #[test]
    fn a_wall_is_hit_and_the_way_to_it_is_free() {
        let told = words(&[[2.25, 0.25, 0.75]]);
        // A cell and a half before it are spared.
        let expected = [
            ([0, 0], "........f.."),
            ([1, 0], "........f.."),
            ([2, 0], "........f.."),
            ([4, 0], "........H.."),
        ];
        assert_eq!(told, expected.map(|(cell, words)| (cell, words.to_owned())));
    }

    #[test]
    fn floor_is_free_and_what_is_far_below_it_says_nothing_of_its_cell() {
        let told = words(&[[1.25, 0.25, 0.0]]);
        assert_eq!(told.last().unwrap(), &([2, 0], ".ff........".to_owned()));
        let told = words(&[[1.25, 0.25, -2.0]]);
        assert_eq!(told.last().unwrap(), &([1, 0], "ff.........".to_owned()));
        // A ceiling is no obstacle.
        assert!(words(&[[0.25, 0.75, 2.0]]).iter().all(|(_, words)| !words.contains('H')));
    }

    #[test]
    fn what_is_too_far_away_says_nothing() {
        assert_eq!(words(&[[11.0, 0.25, 0.75], [f64::NAN, 0.0, 0.0]]), []);
        let lattice = CellLattice::new(0.05, (0.1, 1.0));
        let scan = RayScan::cast(&lattice, [1e6, 0.0, 0.5], std::iter::once([1e6, 0.0, 0.0]));
        assert_eq!(scan.cells().count(), 0);
    }
}
