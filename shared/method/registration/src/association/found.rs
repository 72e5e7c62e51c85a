//! Result of a search, query by query, in columns.

use crate::association::columns::Columns3;
use tessera_surface::Vertex;

/// No vertex was found.
pub(crate) const NONE: u32 = u32::MAX;

/// One place for each query of a pair, filled up to whole lanes with places that found nothing.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// Target vertex, or [`NONE`].
    pub(crate) vertex: Vec<u32>,
    /// Grid row of that vertex.
    pub(crate) row: Vec<f32>,
    /// 1 where the vertex is valid and not at a depth edge, else 0.
    pub(crate) is_inner: Vec<f32>,
    /// Target point and normal; 0 where nothing was found.
    pub(crate) b: Columns3,
    pub(crate) nb: Columns3,
    /// Query normal in the target's frame.
    pub(crate) na: Columns3,
    /// Residual `b - T a` in the target's frame.
    pub(crate) e: Columns3,
    pub(crate) distance_sq: Vec<f32>,
    /// Normal residual in standard deviations of surfaces and pose, without its sign.
    pub(crate) sigmas: Vec<f32>,
    /// Inverse variance of the normal residual; 0 where the place is not a match.
    pub(crate) weight: Vec<f32>,
}

impl Found {
    /// Room for `n` places, a whole number of lanes; each is then [put](Self::put) or [left](Self::leave).
    pub(crate) fn resize(&mut self, n: usize) {
        for column in
            [&mut self.row, &mut self.is_inner, &mut self.distance_sq, &mut self.sigmas, &mut self.weight]
        {
            column.resize(n, 0.0);
        }
        for columns in [&mut self.b, &mut self.nb, &mut self.na, &mut self.e] {
            columns.resize(n);
        }
        self.vertex.resize(n, NONE);
    }

    /// A place that found nothing.
    #[inline(always)]
    pub(crate) fn leave(&mut self, place: usize) {
        self.vertex[place] = NONE;
        (self.row[place], self.is_inner[place]) = (0.0, 0.0);
        self.b.set(place, [0.0; 3]);
        self.nb.set(place, [0.0; 3]);
    }

    pub(crate) fn len(&self) -> usize {
        self.vertex.len()
    }

    #[inline(always)]
    pub(crate) fn put(&mut self, place: usize, vertex: usize, row: usize, v: &Vertex) {
        self.vertex[place] = vertex as u32;
        self.row[place] = row as f32;
        self.is_inner[place] = if v.is_inner() { 1.0 } else { 0.0 };
        self.b.set(place, v.position);
        self.nb.set(place, v.normal);
    }
}
