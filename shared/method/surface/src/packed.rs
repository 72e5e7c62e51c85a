//! Surfaces of keyframes in a fifth of their bytes: rounded to far below the noise of any depth
//! camera, predicted from the vertices around, the residuals in Rice codes.
//!
//! Points are rounded to an eighth of a millimetre, normals to 0.1 to 0.2 degrees; flags and
//! colours stay as they are. First come each third vertex of each third row and those beside them that the caller
//! names, so that these can be read without the others, and travel without them: a narrow link carries
//! [`pack_first`]. What [`unpack`] returns is a function of the bytes and of the named places alone.

mod first;
mod rounded;
mod rows;
mod spread;

pub use crate::packed::first::FirstVertices;
use crate::packed::rounded::Rounded;
use crate::packed::rows::RoundedRows;
use crate::vertex::{Grid, Vertex};
use tessera_numerics::{RiceReader, RiceWriter};

/// From one row or column of the first vertices to the next.
pub const FIRST_SPACING: u8 = 3;

/// A packed surface that is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the bytes are no packed surface of {width} x {height} vertices")]
pub struct UnpackError {
    /// Vertices in a row, as expected.
    pub width: usize,
    /// Rows, as expected.
    pub height: usize,
}

impl UnpackError {
    pub(crate) fn of(grid: Grid) -> Self {
        Self { width: grid.width, height: grid.height }
    }
}

/// Packs the vertices of a grid, row by row; those `beside` the first ones, by their places, come with them.
///
/// # Panics
/// Where `vertices` are not as many as the grid has.
pub fn pack(grid: Grid, vertices: &[Vertex], beside: &[usize]) -> Vec<u8> {
    pack_rows(grid, vertices, beside, |_| ())
}

/// As [`pack`], with what [`unpack`] makes of the bytes, at a third of its cost.
///
/// # Panics
/// As [`pack`].
pub fn pack_and_round(grid: Grid, vertices: &[Vertex], beside: &[usize]) -> (Vec<u8>, Vec<Vertex>) {
    let mut rounded = Vec::with_capacity(grid.len());
    let bytes = pack_rows(grid, vertices, beside, |row| {
        row.append_to(grid.width, &mut rounded);
    });
    (bytes, rounded)
}

/// Packs row by row; `each` is shown the rows as they are rounded.
fn pack_rows(grid: Grid, vertices: &[Vertex], beside: &[usize], mut each: impl FnMut(&Rounded)) -> Vec<u8> {
    assert_eq!(vertices.len(), grid.len(), "vertices of the grid");
    let mut writer = RiceWriter::default();
    let first = FirstVertices::write(&mut writer, grid, &|place| vertices[place], beside);
    let mut rows = RoundedRows::new(grid.width);
    for (row, line) in vertices.chunks_exact(grid.width).enumerate() {
        rows.next();
        rows.set(line.iter());
        first.put(row, &mut rows);
        rows.write(&mut writer);
        each(rows.current());
    }
    writer.finish()
}

/// The vertices of a packed surface, row by row. `beside` as when it was packed.
///
/// # Errors
/// Where the bytes are not of a surface of this grid.
pub fn unpack(grid: Grid, bytes: &[u8], beside: &[usize]) -> Result<Vec<Vertex>, UnpackError> {
    let error = UnpackError::of(grid);
    let mut reader = RiceReader::new(bytes);
    let first = FirstVertices::read(&mut reader, grid, beside).ok_or(error)?;
    let mut rows = RoundedRows::new(grid.width);
    let mut vertices = Vec::with_capacity(grid.len());
    for row in 0..grid.height {
        rows.next();
        first.put(row, &mut rows);
        rows.read(&mut reader).ok_or(error)?;
        rows.current().append_to(grid.width, &mut vertices);
    }
    if reader.is_at_end() { Ok(vertices) } else { Err(error) }
}

/// The first vertices of a packed surface and those beside them. The rest of the bytes is not looked at.
///
/// # Errors
/// Where the bytes do not begin as those of a surface of this grid.
pub fn unpack_first(grid: Grid, bytes: &[u8], beside: &[usize]) -> Result<FirstVertices, UnpackError> {
    FirstVertices::read(&mut RiceReader::new(bytes), grid, beside).ok_or(UnpackError::of(grid))
}

/// Packs the first vertices of a grid alone, and those `beside` them; of the others nothing is asked.
pub fn pack_first(grid: Grid, vertex_at: impl Fn(usize) -> Vertex, beside: &[usize]) -> Vec<u8> {
    let mut writer = RiceWriter::default();
    FirstVertices::write(&mut writer, grid, &vertex_at, beside);
    writer.finish()
}

/// A whole grid of vertices of what [`pack_first`] packed: those between are interpolated where both ends are of
/// one smooth surface. `beside` as when it was packed.
///
/// # Errors
/// Where the bytes are not the first vertices of a surface of this grid.
pub fn unpack_spread(grid: Grid, bytes: &[u8], beside: &[usize]) -> Result<Vec<Vertex>, UnpackError> {
    let mut reader = RiceReader::new(bytes);
    let first = FirstVertices::read(&mut reader, grid, beside).filter(|_| reader.is_at_end());
    Ok(first.ok_or(UnpackError::of(grid))?.spread())
}

/// Few enough to stay in the nearest cache.
const ROUNDED_AT_A_TIME: usize = 160;

/// The vertices after [`pack`] and [`unpack`]: a surface as a keyframe keeps it.
pub fn rounded(vertices: &[Vertex]) -> Vec<Vertex> {
    let mut rounded = Vec::with_capacity(vertices.len());
    let mut run = Rounded::new(ROUNDED_AT_A_TIME);
    for vertices in vertices.chunks(ROUNDED_AT_A_TIME) {
        run.set_all(vertices.iter());
        run.append_to(vertices.len(), &mut rounded);
    }
    rounded
}

#[cfg(test)]
mod tests;
