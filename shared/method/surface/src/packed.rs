//! Surfaces of keyframes in a fifth of their bytes: rounded to far below the noise of any depth
//! camera, predicted from the vertices above and to the left, the residuals in Rice codes.
//!
//! Points are rounded to an eighth of a millimetre, normals to 0.1 to 0.2 degrees; flags and
//! colours stay as they are. What [`unpack`] returns is a function of the bytes alone.

use crate::octahedron;
use crate::vertex::{Grid, Vertex};
use tessera_numerics::{RiceReader, RiceWriter, unzigzag, zigzag};

/// Rounding of the coordinates of a point, metres.
const POINT_STEP_M: f32 = 1.0 / 8192.0;
/// Bits of [`Vertex::flags_rgb`] that are no colour.
const FLAGS: u32 = 0xff;
/// Flag of a vertex with a measurement, above the flags of [`Vertex`].
const MEASURED: u32 = 0x100;

/// Numbers of a vertex, in their order in a row, each with the flag of the vertices that have it
/// (0: all). A point's depth, column and row coordinates, the normal on the octahedron, green, and
/// red and blue less green.
const NUMBERS: [u32; 8] = [MEASURED, MEASURED, MEASURED, Vertex::VALID, Vertex::VALID, 0, 0, 0];

/// A packed surface that is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the bytes are no packed surface of {width} x {height} vertices")]
pub struct UnpackError {
    /// Vertices in a row, as expected.
    pub width: usize,
    /// Rows, as expected.
    pub height: usize,
}

/// Packs the vertices of a grid, row by row.
///
/// # Panics
/// Where `vertices` are not as many as the grid has.
pub fn pack(grid: Grid, vertices: &[Vertex]) -> Vec<u8> {
    pack_rows(grid, vertices, |_| ())
}

/// As [`pack`], with what [`unpack`] makes of the bytes, at a third of its cost.
///
/// # Panics
/// As [`pack`].
pub fn pack_and_round(grid: Grid, vertices: &[Vertex]) -> (Vec<u8>, Vec<Vertex>) {
    let mut rounded = Vec::with_capacity(grid.len());
    let bytes = pack_rows(grid, vertices, |rows| {
        rounded.extend((0..grid.width).map(|column| rows.vertex(column)));
    });
    (bytes, rounded)
}

/// Packs row by row; `each` is shown the rows as they are rounded.
fn pack_rows(grid: Grid, vertices: &[Vertex], mut each: impl FnMut(&RoundedRows)) -> Vec<u8> {
    assert_eq!(vertices.len(), grid.len(), "vertices of the grid");
    let mut rows = RoundedRows::new(grid.width);
    let mut writer = RiceWriter::default();
    let mut codes = Vec::with_capacity(grid.width);
    for line in vertices.chunks_exact(grid.width) {
        rows.next();
        for (column, vertex) in line.iter().enumerate() {
            rows.set(column, vertex);
        }
        writer.row(&changes(&rows.flags));
        for number in 0..NUMBERS.len() {
            codes.clear();
            rows.complete(number, |value, prediction| {
                codes.push(zigzag(value.wrapping_sub(prediction)));
                value
            });
            writer.row(&codes);
        }
        each(&rows);
    }
    writer.finish()
}

/// The vertices of a packed surface, row by row.
///
/// # Errors
/// Where the bytes are not of a surface of this grid.
pub fn unpack(grid: Grid, bytes: &[u8]) -> Result<Vec<Vertex>, UnpackError> {
    unpack_some(grid, bytes, |_| true)
}

/// As [`unpack`], with the vertices of some places alone; at the others there is the default.
///
/// # Errors
/// As [`unpack`].
pub fn unpack_some(
    grid: Grid,
    bytes: &[u8],
    is_wanted: impl Fn(usize) -> bool,
) -> Result<Vec<Vertex>, UnpackError> {
    let error = UnpackError { width: grid.width, height: grid.height };
    let mut rows = RoundedRows::new(grid.width);
    let mut reader = RiceReader::new(bytes);
    let mut vertices = Vec::with_capacity(grid.len());
    let mut codes = vec![0; grid.width];
    for _ in 0..grid.height {
        rows.next();
        reader.row(&mut rows.flags).ok_or(error)?;
        undo_changes(&mut rows.flags);
        for (number, &flag) in NUMBERS.iter().enumerate() {
            let n_present = rows.flags.iter().filter(|&&flags| has(flags, flag)).count();
            reader.row(&mut codes[..n_present]).ok_or(error)?;
            let mut codes = codes[..n_present].iter();
            rows.complete(number, |_, prediction| {
                prediction.wrapping_add(codes.next().map_or(0, |&code| unzigzag(code)))
            });
        }
        let place = vertices.len();
        let vertex = |column| if is_wanted(place + column) { rows.vertex(column) } else { Vertex::default() };
        vertices.extend((0..grid.width).map(vertex));
    }
    if reader.is_at_end() { Ok(vertices) } else { Err(error) }
}

/// What [`unpack`] makes of what [`pack`] makes of the vertices: a surface as a keyframe keeps it.
pub fn rounded(vertices: &[Vertex]) -> Vec<Vertex> {
    let mut rows = RoundedRows::new(1);
    let round = |vertex| {
        rows.set(0, vertex);
        rows.vertex(0)
    };
    vertices.iter().map(round).collect()
}

fn has(flags: u32, flag: u32) -> bool {
    flags & flag == flag
}

/// Flags by what differs from the vertex to the left: mostly 0.
fn changes(flags: &[u32]) -> Vec<u32> {
    let mut left = 0;
    flags.iter().map(|&flags| flags ^ std::mem::replace(&mut left, flags)).collect()
}

fn undo_changes(flags: &mut [u32]) {
    let mut left = 0;
    for flags in flags {
        *flags ^= left;
        left = *flags;
    }
}

/// The row in work and the one above it, as integers.
struct RoundedRows {
    flags: Vec<u32>,
    current: [Vec<i32>; NUMBERS.len()],
    above: [Vec<i32>; NUMBERS.len()],
}

impl RoundedRows {
    fn new(width: usize) -> Self {
        let zeros = || std::array::from_fn(|_| vec![0; width]);
        Self { flags: vec![0; width], current: zeros(), above: zeros() }
    }

    fn next(&mut self) {
        std::mem::swap(&mut self.current, &mut self.above);
    }

    /// Rounds a vertex.
    fn set(&mut self, column: usize, vertex: &Vertex) {
        let is_measured = vertex.position != [0.0; 3];
        self.flags[column] = (vertex.flags_rgb & FLAGS) | if is_measured { MEASURED } else { 0 };
        let [x, y, z] = vertex.position.map(|metres| octahedron::round(metres / POINT_STEP_M));
        let [u, v] = octahedron::from_normal(vertex.normal);
        let [red, green, blue] = vertex.rgb().map(i32::from);
        let numbers = [z, x, y, u, v, green, red - green, blue - green];
        for (row, number) in self.current.iter_mut().zip(numbers) {
            row[column] = number;
        }
    }

    /// The vertex of rounded numbers.
    fn vertex(&self, column: usize) -> Vertex {
        let [z, x, y, u, v, green, red, blue] = std::array::from_fn(|number| self.current[number][column]);
        let flags = self.flags[column];
        let position = [x, y, z].map(|steps| steps as f32 * POINT_STEP_M);
        let rgb = [red.wrapping_add(green), green, blue.wrapping_add(green)].map(|value| value as u8);
        Vertex {
            position: if has(flags, MEASURED) { position } else { [0.0; 3] },
            flags_rgb: Vertex::pack(0, 0, rgb) | (flags & FLAGS),
            normal: if has(flags, Vertex::VALID) { octahedron::to_normal([u, v]) } else { [0.0; 3] },
            reserved: 0,
        }
    }

    /// Walks over the row of one number ([`predict_row`]).
    #[inline]
    fn complete(&mut self, number: usize, value_of: impl FnMut(i32, i32) -> i32) {
        let has_it = |flags: u32| has(flags, NUMBERS[number]);
        predict_row(&mut self.current[number], &self.above[number], &self.flags, has_it, value_of);
    }
}

/// Walks over a row: where a vertex has the number, by its flags, the value becomes what `value_of` makes of it
/// and of its prediction, elsewhere the prediction.
///
/// The prediction is the median of the left value, the one above, and the plane through both and the one
/// between them (Weinberger, Seroussi and Sapiro, "LOCO-I", 1996).
#[inline]
pub(crate) fn predict_row(
    current: &mut [i32],
    above: &[i32],
    flags: &[u32],
    has_it: impl Fn(u32) -> bool,
    mut value_of: impl FnMut(i32, i32) -> i32,
) {
    let (mut left, mut above_left) = (above[0], above[0]);
    for ((value, &above), &flags) in current.iter_mut().zip(above).zip(flags) {
        let plane = left.wrapping_add(above).wrapping_sub(above_left);
        let prediction = plane.clamp(left.min(above), left.max(above));
        *value = if has_it(flags) { value_of(*value, prediction) } else { prediction };
        (left, above_left) = (*value, above);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    const GRID: Grid = Grid { width: 40, height: 30, step: 4 };

    /// A wall with a step, holes, noise and colours.
    fn surface() -> Vec<Vertex> {
        let mut random = SplitMix64::new(1);
        let mut vertices = Vec::new();
        for index in 0..GRID.len() {
            let (row, column) = ((index / GRID.width) as f32, (index % GRID.width) as f32);
            let depth = if column < 25.0 { 1.5 } else { 2.5 } + 0.002 * random.unit() as f32;
            let (x, y) = ((column - 19.5) * depth / 130.0, (row - 14.5) * depth / 130.0);
            let (a, b) = (random.unit() as f32 - 0.5, random.unit() as f32 - 0.5);
            let length = (a * a + b * b + 1.0).sqrt();
            let rgb = [0, 1, 2].map(|channel| (40.0 * channel as f32 + 3.0 * row + column) as u8);
            vertices.push(match random.below(10) {
                0 => Vertex { flags_rgb: Vertex::pack(Vertex::BOUNDARY, 0, rgb), ..Vertex::default() },
                _ => Vertex {
                    position: [x, y, depth],
                    flags_rgb: Vertex::pack(Vertex::VALID, random.below(4) as u32, rgb),
                    normal: [a / length, b / length, -1.0 / length],
                    reserved: 0,
                },
            });
        }
        vertices
    }

    #[test]
    fn a_surface_comes_back_within_the_rounding() {
        let surface = surface();
        let packed = pack(GRID, &surface);
        assert!(packed.len() * 3 < size_of_val(surface.as_slice()), "{} bytes", packed.len());
        let back = unpack(GRID, &packed).unwrap();
        assert_eq!(pack_and_round(GRID, &surface), (packed.clone(), back.clone()));
        assert_eq!(rounded(&surface), back);
        for (back, vertex) in back.iter().zip(&surface) {
            assert_eq!(back.flags_rgb, vertex.flags_rgb);
            let distance = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f32::max);
            assert!(distance(back.position, vertex.position) <= 0.51 * POINT_STEP_M);
            assert!(distance(back.normal, vertex.normal) < 0.003, "{back:?} {vertex:?}");
        }
        let some = unpack_some(GRID, &packed, |place| place % 7 == 3).unwrap();
        for (place, vertex) in some.iter().enumerate() {
            assert_eq!(*vertex, if place % 7 == 3 { back[place] } else { Vertex::default() });
        }
        // Packed again, nothing is lost any more.
        assert_eq!(unpack(GRID, &pack(GRID, &back)).unwrap(), back);
    }

    #[test]
    fn other_bytes_are_an_error() {
        let packed = pack(GRID, &surface());
        assert!(unpack(GRID, &packed[..packed.len() - 1]).is_err());
        assert!(unpack(GRID, &[packed.as_slice(), &[0]].concat()).is_err());
        assert!(unpack(Grid { width: 41, ..GRID }, &packed).is_err());
        let error = unpack(GRID, &[]).unwrap_err().to_string();
        assert!(error.contains("40 x 30"), "{error}");
        let mut random = SplitMix64::new(2);
        for _ in 0..500 {
            let mut damaged = packed.clone();
            let at = random.below(damaged.len());
            damaged[at] = random.next_u64() as u8;
            if let Ok(vertices) = unpack(GRID, &damaged) {
                let is_finite = |v: &Vertex| v.position.iter().chain(&v.normal).all(|n| n.is_finite());
                assert!(vertices.iter().all(is_finite));
            }
        }
    }
}
