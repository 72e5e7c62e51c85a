//! A frame's samples, and a choice of them moved to the frame's stamp, ready to be matched.

use crate::association::columns::Columns3;
use crate::association::target::ShutterTable;
use crate::sampling::Sample;
use tessera_numerics::lanes::{LANES, Lanes};

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
        // `(k n + shift) / count`, without a division for each.
        let (whole, part) = (n / count.max(1), n % count.max(1));
        let (mut place, mut rest) = (shift / count.max(1), shift % count.max(1));
        (0..count).map(move |_| {
            let now = place;
            (place, rest) = (place + whole, rest + part);
            if rest >= count {
                (place, rest) = (place + 1, rest - count);
            }
            now
        })
    }
}

/// The samples of a frame, as exposed, with the frame's readout motion.
#[derive(Clone, Debug, Default)]
pub struct Queries {
    samples: Vec<Sample>,
    shutter: ShutterTable,
}

impl Queries {
    /// Takes samples over.
    pub fn fill(&mut self, samples: &[Sample], shutter: &ShutterTable) {
        self.samples.clear();
        self.samples.extend_from_slice(samples);
        self.shutter = *shutter;
    }

    /// The same samples with another readout motion.
    pub fn set_shutter(&mut self, shutter: &ShutterTable) {
        self.shutter = *shutter;
    }

    pub(crate) fn shutter(&self) -> ShutterTable {
        self.shutter
    }

    /// Number of queries.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }
}

/// Queries of one pair, in columns that are filled up to whole lanes with points at the camera.
#[derive(Clone, Debug, Default)]
pub(crate) struct Chosen {
    /// Points and normals in the camera frame: as exposed, then at the frame's stamp.
    pub(crate) points: Columns3,
    pub(crate) normals: Columns3,
    rows: Vec<f32>,
}

impl Chosen {
    /// Copies a selection, as exposed; the number of queries in it.
    pub(crate) fn choose(&mut self, from: &Queries, selection: Selection) -> usize {
        let n = selection.count.min(from.len());
        self.points.resize(n);
        self.normals.resize(n);
        self.rows.resize(n, 0.0);
        for (k, place) in selection.places(from.len()).enumerate() {
            let sample = &from.samples[place];
            self.points.set(k, sample.point);
            self.normals.set(k, sample.normal);
            self.rows[k] = f32::from(sample.grid_row);
        }
        let filled = n.next_multiple_of(LANES);
        self.points.resize(filled);
        self.normals.resize(filled);
        self.rows.resize(filled, 0.0);
        n
    }

    /// Their rows in the grid.
    pub(crate) fn rows(&self) -> &[f32] {
        &self.rows
    }

    pub(crate) fn len(&self) -> usize {
        self.rows.len()
    }
}

/// Takes the readout motion out of the chosen queries.
pub(crate) struct Straighten<'a> {
    pub(crate) chosen: &'a mut Chosen,
    pub(crate) shutter: ShutterTable,
}

impl pulp::WithSimd for Straighten<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let Straighten { chosen, shutter } = self;
        if shutter.is_global() {
            return;
        }
        for at in (0..chosen.len()).step_by(LANES) {
            let seconds = shutter.inner_row_time_s(Lanes::load(&chosen.rows, at));
            chosen.points.store(at, shutter.move_point(chosen.points.load(at), seconds));
            chosen.normals.store(at, shutter.turn(chosen.normals.load(at), seconds));
        }
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
