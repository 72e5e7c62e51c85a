//! Samples moved to their frame's stamp, ready to be matched.

use crate::columns::Columns3;
use crate::sampling::Sample;
use crate::target::ShutterTable;

/// An even choice of queries: `count` of them, from all over the list. Different shifts choose
/// different ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Selection {
    /// Queries wanted; all, if there are fewer.
    pub count: usize,
    /// Which of the choices of this size: any number.
    pub shift: usize,
}

impl Selection {
    /// Places in a list of `n`, rising.
    pub(crate) fn places(self, n: usize) -> impl Iterator<Item = usize> {
        let count = self.count.min(n);
        // A large odd step spreads consecutive shifts over the gap between two places.
        let shift = if n > 0 { self.shift.wrapping_mul(7919) % n } else { 0 };
        (0..count).map(move |k| (k * n + shift) / count)
    }
}

/// Query points and normals in the camera frame at the frame's stamp.
#[derive(Clone, Debug, Default)]
pub struct Queries {
    pub(crate) points: Columns3,
    pub(crate) normals: Columns3,
}

impl Queries {
    /// Removes the readout motion from the samples.
    pub fn fill(&mut self, samples: &[Sample], shutter: &ShutterTable) {
        self.points.clear();
        self.normals.clear();
        for sample in samples {
            let seconds = shutter.row_time_s(f32::from(sample.grid_row));
            self.points.push(shutter.move_point(sample.point, seconds));
            self.normals.push(shutter.turn(sample.normal, seconds));
        }
    }

    /// Copies a selection, so that loops over it read one run of memory.
    pub(crate) fn choose(&mut self, from: &Self, selection: Selection) {
        self.points.clear();
        self.normals.clear();
        for place in selection.places(from.len()) {
            self.points.push(from.points.at(place));
            self.normals.push(from.normals.at(place));
        }
    }

    /// Number of queries.
    pub fn len(&self) -> usize {
        self.points.x.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.points.x.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_selection_is_even_and_inside() {
        for (n, count) in [(2000, 800), (7, 7), (7, 20), (5, 1), (0, 3)] {
            for shift in [0, 1, 2, 97] {
                let places: Vec<usize> = Selection { count, shift }.places(n).collect();
                assert_eq!(places.len(), count.min(n));
                assert!(places.windows(2).all(|w| w[0] < w[1]) && places.iter().all(|&p| p < n));
            }
        }
        let places = |shift| Selection { count: 800, shift }.places(2000).collect::<Vec<_>>();
        assert_ne!(places(0), places(1));
    }
}
