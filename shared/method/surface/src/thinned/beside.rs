//! Vertices beside the kept ones: a caller names places whose depth matters more, as those under features, which
//! lie at edges where nothing can be interpolated. Each is told by what differs from what its reader would take.

use super::Thinning;
use super::rays::Rays;
use super::rounded::RoundedVertex;
use crate::vertex::{Grid, Vertex};
use tessera_numerics::{BitCoder, BitModel, NumberModel};

/// Depth and normal: colours are those of what is taken instead.
const TOLD: usize = 3;
/// The substitute: a vertex between the kept ones, the nearest kept one, the one told last, or none.
const KINDS: usize = 4;

/// Writes vertices beside the kept ones, or reads them.
pub(super) struct BetweenVertices {
    grid: Grid,
    rays: Rays,
    thinning: Thinning,
    last: RoundedVertex,
    is_told: [BitModel; KINDS],
    is_same: [BitModel; KINDS],
    flags: NumberModel,
    numbers: [[NumberModel; TOLD]; KINDS],
}

impl BetweenVertices {
    pub(super) fn new(grid: Grid, rays: Rays, thinning: Thinning) -> Self {
        let [is_told, is_same] = Default::default();
        let numbers = std::array::from_fn(|_| std::array::from_fn(|_| NumberModel::default()));
        let (last, flags) = Default::default();
        Self { grid, rays, thinning, last, is_told, is_same, flags, numbers }
    }

    /// The vertex at a place, which the writer names and the reader is told; `between`: what the reader has there
    /// so far, and `nearest`: the nearest kept one. `None` where there is nothing to tell, or what is told is no
    /// vertex.
    pub(super) fn code(
        &mut self,
        coder: &mut impl BitCoder,
        place: usize,
        [between, nearest]: [Vertex; 2],
        own: Option<&Vertex>,
    ) -> Option<Vertex> {
        let (row, column) = (place / self.grid.width, place % self.grid.width);
        let ray = self.rays.at(row, column);
        let rounded = |vertex: &Vertex| {
            RoundedVertex::of(self.thinning, vertex, self.rays.depth_m(vertex, ray)).filter(|v| v.is_valid())
        };
        let (kind, instead) = [rounded(&between), rounded(&nearest), self.last.some_valid()]
            .into_iter()
            .enumerate()
            .find_map(|(kind, vertex)| Some((kind, vertex?)))
            .unwrap_or((KINDS - 1, RoundedVertex::default()));
        let own = own.filter(|vertex| vertex.is_inner()).and_then(rounded);
        if !coder.bit(&mut self.is_told[kind], own.is_some()) {
            return None;
        }
        let own = own.unwrap_or_default();
        let mut told = instead;
        if !coder.bit(&mut self.is_same[kind], own.flags == instead.flags) {
            told.flags = instead.flags ^ self.flags.magnitude(coder, own.flags ^ instead.flags);
        }
        for (number, model) in self.numbers[kind].iter_mut().enumerate() {
            let residual = own.numbers[number].wrapping_sub(instead.numbers[number]);
            told.numbers[number] = instead.numbers[number].wrapping_add(model.signed(coder, residual));
        }
        self.last = told;
        told.vertex(self.thinning, ray)
    }
}
