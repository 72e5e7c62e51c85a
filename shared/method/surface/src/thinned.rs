//! Surfaces for a narrow link: each n-th vertex of each n-th row, rounded to a fraction of the sensor's
//! noise and predicted from those above and to the left; the vertices between are interpolated by the reader.
//!
//! Each vertex is slid along its tangent plane to the ray of its place in the grid, so that its depth says where it
//! is. Depth is rounded as its inverse, in which the noise of a depth camera is about the same at all distances,
//! by steps that the bytes tell ([`Thinning`]), normals likewise, colours to an eighth of their range. Residuals go
//! through a range coder whose probabilities follow the residuals around. Vertices at places that the caller names
//! are kept too. What [`unpack`] returns is a function of the bytes and these places alone.

mod beside;
mod interpolated;
mod rays;
mod rounded;
mod rows;

use crate::packed::UnpackError;
use crate::thinned::beside::BetweenVertices;
use crate::thinned::interpolated::{interpolate, interpolated};
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

    /// The kept vertices of a grid.
    fn kept(self, grid: Grid) -> (usize, usize) {
        (grid.width.div_ceil(self.step()), grid.height.div_ceil(self.step()))
    }

    fn step(self) -> usize {
        self.spacing.into()
    }

    fn depth_step(self) -> f32 {
        1.0 / f32::from(self.inverse_depth_steps)
    }
}

/// The places of a grid that [`pack`] looks at, place by place: the kept ones and those beside them.
pub fn looked_at(grid: Grid, beside: &[usize], thinning: Thinning) -> Vec<bool> {
    let mut is_looked_at = vec![false; grid.len()];
    for row in (0..grid.height).step_by(thinning.step()) {
        let kept = (0..grid.width).step_by(thinning.step());
        kept.for_each(|column| is_looked_at[row * grid.width + column] = true);
    }
    beside.iter().filter(|place| **place < grid.len()).for_each(|&place| is_looked_at[place] = true);
    is_looked_at
}

/// Packs the vertices of a grid, row by row, and behind them those `beside` the kept ones, by their places in the
/// grid. Of the others ([`looked_at`]) nothing is read.
///
/// # Panics
/// Where `vertices` are not as many as the grid has, or the thinning is none.
pub fn pack(grid: Grid, vertices: &[Vertex], beside: &[usize], thinning: Thinning) -> Vec<u8> {
    assert_eq!(vertices.len(), grid.len(), "vertices of the grid");
    assert_eq!(Thinning::read(thinning.bytes()), Some(thinning), "a thinning");
    let rays = Rays::of(grid, vertices, thinning.step());
    let mut writer = RangeWriter::default();
    let mut surface = ThinnedSurface { grid, rays, thinning };
    surface.code(&mut writer, beside, Some(vertices));
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
    let vertices = surface.code(&mut reader, beside, None).ok_or(error)?;
    if reader.ends() { Ok(vertices) } else { Err(error) }
}

/// A surface on its way into bytes or out of them.
struct ThinnedSurface {
    grid: Grid,
    rays: Rays,
    thinning: Thinning,
}

impl ThinnedSurface {
    /// Writes the vertices `own`, or reads all that a reader has. `None` where a vertex has no depth.
    fn code(
        &mut self,
        coder: &mut impl BitCoder,
        beside: &[usize],
        own: Option<&[Vertex]>,
    ) -> Option<Vec<Vertex>> {
        let Self { grid, rays, thinning } = *self;
        let ((width, height), step) = (thinning.kept(grid), thinning.step());
        let (mut rows, mut models) = (ThinnedRows::new(width, thinning), Models::default());
        let mut vertices = vec![Vertex::default(); grid.len()];
        for row in (0..height).map(|row| row * step) {
            rows.next();
            let columns = (0..width).map(|column| (column, column * step));
            for (kept, column) in columns.clone().filter(|_| own.is_some()) {
                let vertex = &own?[row * grid.width + column];
                rows.set(kept, vertex, rays.depth_m(vertex, rays.at(row, column)));
            }
            rows.code(coder, &mut models);
            for (kept, column) in columns {
                vertices[row * grid.width + column] = rows.vertex(kept, rays.at(row, column))?;
            }
        }
        // A writer needs a few of them.
        if own.is_none() {
            interpolate(grid, step, &mut vertices);
        }
        let mut others = BetweenVertices::new(grid, rays, thinning);
        let is_between = |place: usize| {
            !((place / grid.width).is_multiple_of(step) && (place % grid.width).is_multiple_of(step))
        };
        let mut told = Vec::new();
        for place in beside.iter().copied().filter(|place| *place < grid.len() && is_between(*place)) {
            let between = match own {
                Some(_) => interpolated(grid, step, &vertices, place),
                None => vertices[place],
            };
            let own = own.map(|own| &own[place]);
            let nearest = vertices[nearest_kept(grid, thinning, place)];
            told.extend(others.code(coder, place, [between, nearest], own).map(|vertex| (place, vertex)));
        }
        told.into_iter().for_each(|(place, vertex)| vertices[place] = vertex);
        Some(vertices)
    }
}

/// The place of the kept vertex nearest to a place.
fn nearest_kept(grid: Grid, thinning: Thinning, place: usize) -> usize {
    let ((width, height), step) = (thinning.kept(grid), thinning.step());
    let (row, column) = (place / grid.width, place % grid.width);
    let nearest = |at: usize, n: usize| ((at + step / 2) / step).min(n - 1) * step;
    nearest(row, height) * grid.width + nearest(column, width)
}

#[cfg(test)]
mod tests;
