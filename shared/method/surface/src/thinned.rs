//! Surfaces for a narrow link: each n-th vertex of each n-th row, rounded to a fraction of the sensor's
//! noise and predicted from those above and to the left; the vertices between are interpolated by the reader.
//!
//! Each vertex is slid along its tangent plane to the ray of its place in the grid, so that its depth gives its
//! position. Depth is rounded as its inverse, in which the noise of a depth camera is about the same at all distances,
//! by steps that the bytes tell ([`Thinning`]), normals likewise, colours to an eighth of their range. Residuals go
//! through a range coder whose probabilities follow the residuals around. Vertices at places that the caller names
//! are kept too. What [`unpack`] returns is a function of the bytes and these places alone.

mod beside;
mod kept;
mod rays;
mod rounded;
mod rows;

use crate::packed::UnpackError;
use crate::thinned::beside::BetweenVertices;
use crate::thinned::kept::KeptVertices;
use crate::thinned::rays::Rays;
use crate::thinned::rows::{Models, ThinnedRows};
use crate::vertex::{Grid, Vertex};
use tessera_numerics::{BitCoder, RangeReader, RangeWriter};

/// Which vertices are kept, and by what their depth and normals are rounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Thinning {
    /// From one kept row or column to the next, 1 to [`MOST_SPACING`].
    pub spacing: u8,
    /// Steps of the inverse of depth, per 1/m, at least 1: 4096 are 1 mm at 2 m, an eighth of the noise (eq. 5).
    pub inverse_depth_steps: u16,
    /// Steps of a normal from the centre of the octahedral map to its border, at least 1: 31 are 2 degrees.
    pub normal_steps: u8,
}

/// Largest [`Thinning::spacing`].
pub const MOST_SPACING: u8 = 8;

impl Thinning {
    /// The numbers of four bytes; `None` where they are none of a thinning.
    fn read([spacing, low, high, normal_steps]: [u8; 4]) -> Option<Self> {
        let inverse_depth_steps = u16::from_le_bytes([low, high]);
        let is_usable = (1..=MOST_SPACING).contains(&spacing) && inverse_depth_steps > 0 && normal_steps > 0;
        is_usable.then_some(Self { spacing, inverse_depth_steps, normal_steps })
    }

    fn bytes(self) -> [u8; 4] {
        let [low, high] = self.inverse_depth_steps.to_le_bytes();
        [self.spacing, low, high, self.normal_steps]
    }

    fn step(self) -> usize {
        self.spacing.into()
    }

    fn depth_step(self) -> f32 {
        1.0 / f32::from(self.inverse_depth_steps)
    }
}

/// Packs the vertices of a grid, row by row, and behind them those `beside` the kept ones, by their places in the
/// grid. Of the others nothing is asked.
///
/// # Panics
/// Where the thinning is none.
pub fn pack(
    grid: Grid,
    vertex_at: impl Fn(usize) -> Vertex,
    beside: &[usize],
    thinning: Thinning,
) -> Vec<u8> {
    assert_eq!(Thinning::read(thinning.bytes()), Some(thinning), "a thinning");
    let vertices = KeptVertices::of(grid, thinning.step(), &vertex_at);
    let rays = Rays::of(&vertices);
    let mut writer = RangeWriter::default();
    let mut surface = ThinnedSurface { grid, rays, thinning };
    let kept = surface.code_kept(&mut writer, Some(vertices)).expect("a writer has all vertices");
    surface.code_beside(&mut writer, beside, &kept, Some(&vertex_at));
    let [a, b, c, d] = rays.0.map(f32::to_le_bytes);
    [a.as_slice(), &b, &c, &d, &thinning.bytes(), &writer.finish()].concat()
}

/// The vertices of a packed surface, row by row, those between the kept ones interpolated. `beside` as when it was
/// packed.
///
/// # Errors
/// Where the bytes are not of a surface of this grid.
pub fn unpack(grid: Grid, bytes: &[u8], beside: &[usize]) -> Result<Vec<Vertex>, UnpackError> {
    let error = UnpackError { width: grid.width, height: grid.height };
    let (rays, bytes) = Rays::read(bytes).ok_or(error)?;
    let (head, bytes) = bytes.split_first_chunk().ok_or(error)?;
    let thinning = Thinning::read(*head).ok_or(error)?;
    let mut reader = RangeReader::new(bytes);
    let mut surface = ThinnedSurface { grid, rays, thinning };
    let kept = surface.code_kept(&mut reader, None).ok_or(error)?;
    let mut vertices = kept.spread();
    let told = surface.code_beside(&mut reader, beside, &kept, None::<&fn(usize) -> Vertex>);
    told.into_iter().for_each(|(place, vertex)| vertices[place] = vertex);
    if reader.ends() { Ok(vertices) } else { Err(error) }
}

/// A surface on its way into bytes or out of them.
struct ThinnedSurface {
    grid: Grid,
    rays: Rays,
    thinning: Thinning,
}

impl ThinnedSurface {
    /// Writes the kept vertices `own`, or reads them; returns them row by row as a reader has them. `None` where a
    /// vertex has no depth.
    fn code_kept(&mut self, coder: &mut impl BitCoder, own: Option<KeptVertices>) -> Option<KeptVertices> {
        let Self { grid, rays, thinning } = *self;
        let step = thinning.step();
        let writes = own.is_some();
        let mut kept = own.unwrap_or_else(|| KeptVertices::new(grid, step));
        let (mut rows, mut models) = (ThinnedRows::new(kept.width(), thinning), Models::default());
        for row in 0..kept.height() {
            rows.next();
            for column in (0..kept.width()).filter(|_| writes) {
                let vertex = kept.at(row, column);
                rows.set(column, vertex, rays.depth_m(vertex, rays.at(row * step, column * step)));
            }
            rows.code(coder, &mut models);
            for column in 0..kept.width() {
                *kept.at_mut(row, column) = rows.vertex(column, rays.at(row * step, column * step))?;
            }
        }
        Some(kept)
    }

    /// Writes the vertices `own` beside the kept ones, or reads them: what a reader has, by their places.
    fn code_beside(
        &mut self,
        coder: &mut impl BitCoder,
        beside: &[usize],
        kept: &KeptVertices,
        own: Option<&impl Fn(usize) -> Vertex>,
    ) -> Vec<(usize, Vertex)> {
        let Self { grid, rays, thinning } = *self;
        let step = thinning.step();
        let mut others = BetweenVertices::new(grid, rays, thinning);
        let is_between = |place: usize| {
            !((place / grid.width).is_multiple_of(step) && (place % grid.width).is_multiple_of(step))
        };
        let mut told = Vec::new();
        for place in beside.iter().copied().filter(|place| *place < grid.len() && is_between(*place)) {
            let own = own.map(|own| own(place));
            let found =
                others.code(coder, place, [kept.interpolated(place), kept.nearest(place)], own.as_ref());
            told.extend(found.map(|vertex| (place, vertex)));
        }
        told
    }
}

#[cfg(test)]
mod tests;
