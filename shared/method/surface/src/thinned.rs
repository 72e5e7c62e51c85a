//! Surfaces for a narrow link: each second vertex of each second row, rounded to a fraction of the sensor's
//! noise and predicted from those above and to the left; the vertices between are interpolated by the reader.
//!
//! Each vertex is slid along its tangent plane to the ray of its place in the grid, so that its depth says where it
//! is. Depth is rounded as its inverse, in which the noise of a depth camera is about the same at all distances,
//! normals to a degree or two, colours to an eighth of their range. What [`unpack`] returns is a function of the
//! bytes alone.

use crate::octahedron::{from_normal_by, round, to_normal_by};
use crate::packed::{UnpackError, predict_row};
use crate::vertex::{Grid, Vertex};
use tessera_numerics::{RiceReader, RiceWriter, unzigzag, zigzag};

/// Rounding of the inverse of depth, 1/m: 1 mm at 2 m, an eighth of the noise (eq. 5).
const INVERSE_DEPTH_STEP: f32 = 1.0 / 4096.0;
/// Steps of a normal from the centre of the octahedral map to its border.
const NORMAL_STEPS: f32 = 31.0;
/// Rounding of colours, of 256 levels.
const COLOUR_STEP: i32 = 32;
/// A vertex whose depth would change by more than this part on its way along the tangent plane keeps it.
const MOST_SLIDE: f32 = 0.03;
/// Bits of [`Vertex::flags_rgb`] that are no colour.
const FLAGS: u32 = 0xff;
/// Numbers of a vertex: inverse depth, normal on the octahedron, green, and red and blue less green. Only valid
/// vertices have any.
const NUMBERS: usize = 6;
/// Farthest two kept vertices may be from each other's tangent planes for one to stand between them, as part
/// of their depth.
const MOST_BEND: f32 = 0.01;

/// The kept vertices of a grid.
fn kept(grid: Grid) -> (usize, usize) {
    (grid.width.div_ceil(2), grid.height.div_ceil(2))
}

/// Packs the vertices of a grid, row by row.
///
/// # Panics
/// Where `vertices` are not as many as the grid has.
pub fn pack(grid: Grid, vertices: &[Vertex]) -> Vec<u8> {
    assert_eq!(vertices.len(), grid.len(), "vertices of the grid");
    let rays = Rays::of(grid, vertices);
    let mut rows = ThinnedRows::new(kept(grid).0);
    let mut writer = RiceWriter::default();
    let mut codes = Vec::with_capacity(rows.flags.len());
    for (row, line) in vertices.chunks_exact(grid.width).enumerate().step_by(2) {
        rows.next();
        for (column, vertex) in line.iter().enumerate().step_by(2) {
            rows.set(column / 2, vertex, rays.depth_m(vertex, rays.at(row, column)));
        }
        let mut left = 0;
        codes.clear();
        codes.extend(rows.flags.iter().map(|&flags| flags ^ std::mem::replace(&mut left, flags)));
        writer.row(&codes);
        for number in 0..NUMBERS {
            codes.clear();
            rows.complete(number, |value, prediction| {
                codes.push(zigzag(value.wrapping_sub(prediction)));
                value
            });
            writer.row(&codes);
        }
    }
    let [a, b, c, d] = rays.0.map(f32::to_le_bytes);
    [a.as_slice(), &b, &c, &d, &writer.finish()].concat()
}

/// The vertices of a packed surface, row by row, those between the kept ones interpolated.
///
/// # Errors
/// Where the bytes are not of a surface of this grid.
pub fn unpack(grid: Grid, bytes: &[u8]) -> Result<Vec<Vertex>, UnpackError> {
    let error = UnpackError { width: grid.width, height: grid.height };
    let (width, height) = kept(grid);
    let mut rows = ThinnedRows::new(width);
    let (rays, bytes) = Rays::read(bytes).ok_or(error)?;
    let mut reader = RiceReader::new(bytes);
    let mut vertices = vec![Vertex::default(); grid.len()];
    let mut codes = vec![0; width];
    for row in 0..height {
        rows.next();
        reader.row(&mut rows.flags).ok_or(error)?;
        let mut left = 0;
        for flags in &mut rows.flags {
            *flags ^= left;
            left = *flags;
        }
        let n_valid = rows.flags.iter().filter(|&&flags| is_valid(flags)).count();
        for number in 0..NUMBERS {
            reader.row(&mut codes[..n_valid]).ok_or(error)?;
            let mut codes = codes[..n_valid].iter();
            rows.complete(number, |_, prediction| {
                prediction.wrapping_add(codes.next().map_or(0, |&code| unzigzag(code)))
            });
        }
        let line = &mut vertices[2 * row * grid.width..][..grid.width];
        for (column, vertex) in line.iter_mut().step_by(2).enumerate() {
            *vertex = rows.vertex(column, rays.at(2 * row, 2 * column)).ok_or(error)?;
        }
    }
    if !reader.is_at_end() {
        return Err(error);
    }
    interpolate(grid, &mut vertices);
    Ok(vertices)
}

/// Fills in the vertices between the kept ones: first those of the kept rows, then the rows between.
fn interpolate(grid: Grid, vertices: &mut [Vertex]) {
    let Grid { width, height, .. } = grid;
    for row in (0..height).step_by(2) {
        for at in (1..width.saturating_sub(1)).step_by(2).map(|column| row * width + column) {
            vertices[at] = between(&vertices[at - 1], &vertices[at + 1]);
        }
    }
    for row in (1..height.saturating_sub(1)).step_by(2) {
        for at in row * width..(row + 1) * width {
            vertices[at] = between(&vertices[at - width], &vertices[at + width]);
        }
    }
}

/// The vertex in the middle of two, where both are of one smooth surface.
fn between(a: &Vertex, b: &Vertex) -> Vertex {
    if !(a.is_valid() && b.is_valid()) {
        return Vertex::default();
    }
    let offset: [f32; 3] = std::array::from_fn(|k| b.position[k] - a.position[k]);
    let off_plane = |normal: [f32; 3]| (0..3).map(|k| normal[k] * offset[k]).sum::<f32>().abs();
    let most_m = MOST_BEND * a.position[2].min(b.position[2]);
    let sum: [f32; 3] = std::array::from_fn(|k| a.normal[k] + b.normal[k]);
    let length = sum.iter().map(|v| v * v).sum::<f32>().sqrt();
    // Normals of more than 90 degrees between them are no smooth surface.
    let is_smooth = off_plane(a.normal).max(off_plane(b.normal)) <= most_m && length >= 1.5;
    if !is_smooth {
        return Vertex::default();
    }
    let rgb = std::array::from_fn(|k| ((u16::from(a.rgb()[k]) + u16::from(b.rgb()[k])) / 2) as u8);
    let is_boundary = !a.is_inner() && !b.is_inner();
    let flags = Vertex::VALID | if is_boundary { Vertex::BOUNDARY } else { 0 };
    Vertex {
        position: std::array::from_fn(|k| a.position[k] + 0.5 * offset[k]),
        flags_rgb: Vertex::pack(flags, (a.row_offset() + b.row_offset()) / 2, rgb),
        normal: sum.map(|v| v / length),
        reserved: 0,
    }
}

/// The rays of a grid's places: column coordinate over depth as a line over the columns, row coordinate as one
/// over the rows.
#[derive(Clone, Copy)]
struct Rays([f32; 4]);

impl Rays {
    /// The least squares fit to the valid vertices: which ray a vertex is slid to does not matter much.
    fn of(grid: Grid, vertices: &[Vertex]) -> Self {
        let (mut columns, mut rows) = (LineFit::default(), LineFit::default());
        for (at, vertex) in vertices.iter().enumerate().filter(|(_, v)| v.is_valid() && v.position[2] > 0.0) {
            let [x, y, z] = vertex.position.map(f64::from);
            columns.add((at % grid.width) as f64, x / z);
            rows.add((at / grid.width) as f64, y / z);
        }
        let ([a, b], [c, d]) = (columns.line(), rows.line());
        Self([a, b, c, d])
    }

    fn read(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let (head, rest) = bytes.split_first_chunk::<16>()?;
        let number = |at: usize| f32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let numbers = [0, 4, 8, 12].map(number);
        // Beyond, no camera looks; a number that is none is beyond too.
        numbers.iter().all(|number| number.abs() < 1e3).then_some((Self(numbers), rest))
    }

    fn at(self, row: usize, column: usize) -> [f32; 3] {
        let [a, b, c, d] = self.0;
        [a * column as f32 + b, c * row as f32 + d, 1.0]
    }

    /// Where a ray meets the tangent plane of a vertex.
    fn depth_m(self, vertex: &Vertex, ray: [f32; 3]) -> f32 {
        let dot = |v: [f32; 3]| (0..3).map(|k| vertex.normal[k] * v[k]).sum::<f32>();
        let (depth_m, met_m) = (vertex.position[2], dot(vertex.position) / dot(ray));
        // Written so that a ray along the plane changes nothing.
        if (met_m - depth_m).abs() <= MOST_SLIDE * depth_m { met_m } else { depth_m }
    }
}

/// A line through points.
#[derive(Default)]
struct LineFit {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
}

impl LineFit {
    fn add(&mut self, x: f64, y: f64) {
        self.n += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.xy += x * y;
    }

    /// Slope and height at zero; level where the points do not say.
    fn line(&self) -> [f32; 2] {
        let n = self.n.max(1.0);
        let spread = self.xx - self.x * self.x / n;
        let slope = if spread > 0.5 { (self.xy - self.x * self.y / n) / spread } else { 0.0 };
        [slope as f32, ((self.y - slope * self.x) / n) as f32]
    }
}

fn is_valid(flags: u32) -> bool {
    flags & Vertex::VALID != 0
}

/// The row in work and the one above it, as integers.
struct ThinnedRows {
    flags: Vec<u32>,
    current: [Vec<i32>; NUMBERS],
    above: [Vec<i32>; NUMBERS],
}

impl ThinnedRows {
    fn new(width: usize) -> Self {
        let zeros = || std::array::from_fn(|_| vec![0; width]);
        Self { flags: vec![0; width], current: zeros(), above: zeros() }
    }

    fn next(&mut self) {
        std::mem::swap(&mut self.current, &mut self.above);
    }

    /// Rounds a vertex.
    fn set(&mut self, column: usize, vertex: &Vertex, depth_m: f32) {
        let inverse = round(1.0 / depth_m / INVERSE_DEPTH_STEP);
        let is_usable = vertex.is_valid() && depth_m > 0.0 && inverse > 0;
        self.flags[column] = if is_usable { vertex.flags_rgb & FLAGS } else { 0 };
        if !is_usable {
            return;
        }
        let [u, v] = from_normal_by(NORMAL_STEPS, vertex.normal);
        let [red, green, blue] = vertex.rgb().map(|value| i32::from(value) / COLOUR_STEP);
        let numbers = [inverse, u, v, green, red - green, blue - green];
        for (row, number) in self.current.iter_mut().zip(numbers) {
            row[column] = number;
        }
    }

    /// The vertex of rounded numbers; `None` where there is none of that depth.
    fn vertex(&self, column: usize, ray: [f32; 3]) -> Option<Vertex> {
        let flags = self.flags[column];
        if !is_valid(flags) {
            return Some(Vertex::default());
        }
        let numbers: [i32; NUMBERS] = std::array::from_fn(|number| self.current[number][column]);
        let [inverse, u, v, green, red, blue] = numbers;
        let depth_m = 1.0 / (inverse as f32 * INVERSE_DEPTH_STEP);
        let middle = |value: i32| (value.clamp(0, 255 / COLOUR_STEP) * COLOUR_STEP + COLOUR_STEP / 2) as u8;
        let rgb = [red.wrapping_add(green), green, blue.wrapping_add(green)];
        (inverse > 0).then(|| Vertex {
            position: ray.map(|v| v * depth_m),
            flags_rgb: Vertex::pack(0, 0, rgb.map(middle)) | (flags & FLAGS),
            normal: to_normal_by(NORMAL_STEPS, [u, v]),
            reserved: 0,
        })
    }

    /// Walks over the row of one number ([`predict_row`]).
    fn complete(&mut self, number: usize, value_of: impl FnMut(i32, i32) -> i32) {
        predict_row(&mut self.current[number], &self.above[number], &self.flags, is_valid, value_of);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    const GRID: Grid = Grid { width: 41, height: 30, step: 4 };

    /// A sloped wall with a step, noise and holes.
    fn surface(one_hole_in: usize) -> Vec<Vertex> {
        let mut random = SplitMix64::new(1);
        let mut vertices = Vec::new();
        for index in 0..GRID.len() {
            let (row, column) = ((index / GRID.width) as f32, (index % GRID.width) as f32);
            let (u, v) = ((column - 20.0) / 130.0, (row - 14.5) / 130.0);
            // The plane z = d + 0.2 x.
            let depth =
                if column < 25.0 { 1.5 } else { 2.5 } / (1.0 - 0.2 * u) + 0.001 * random.unit() as f32;
            let length = 1.04_f32.sqrt();
            vertices.push(match random.below(one_hole_in) {
                0 => Vertex::default(),
                _ => Vertex {
                    position: [u * depth, v * depth, depth],
                    flags_rgb: Vertex::pack(Vertex::VALID, 1, [9, 100, 255]),
                    normal: [0.2 / length, 0.0, -1.0 / length],
                    reserved: 0,
                },
            });
        }
        vertices
    }

    #[test]
    fn a_wall_comes_back_within_a_fraction_of_the_noise() {
        let surface = surface(usize::MAX);
        let bytes = pack(GRID, &surface);
        assert!(bytes.len() < 4 * kept(GRID).0 * kept(GRID).1, "{} bytes", bytes.len());
        let back = unpack(GRID, &bytes).unwrap();
        let mut n_missing = 0;
        for (at, (back, vertex)) in back.iter().zip(&surface).enumerate() {
            let (row, column) = (at / GRID.width, at % GRID.width);
            if !back.is_valid() {
                // The last row has none below it, and nothing stands between wall and step.
                assert!(row == GRID.height - 1 || column == 25, "row {row} column {column}");
                n_missing += 1;
                continue;
            }
            let off = (0..3).map(|k| (back.position[k] - vertex.position[k]) * vertex.normal[k]).sum::<f32>();
            assert!(off.abs() < 0.0025, "{off} m at row {row} column {column}");
            let dot = (0..3).map(|k| back.normal[k] * vertex.normal[k]).sum::<f32>();
            assert!(dot > 0.999 && back.row_offset() == 1, "{dot}");
            assert!((0..3).all(|k| back.rgb()[k].abs_diff(vertex.rgb()[k]) <= 16), "{:?}", back.rgb());
        }
        assert!(n_missing <= GRID.width + GRID.height);
    }

    #[test]
    fn nothing_stands_where_nothing_was_seen() {
        let bytes = pack(GRID, &vec![Vertex::default(); GRID.len()]);
        assert_eq!(unpack(GRID, &bytes).unwrap(), vec![Vertex::default(); GRID.len()]);
        let surface = surface(4);
        let back = unpack(GRID, &pack(GRID, &surface)).unwrap();
        for (at, (back, vertex)) in back.iter().zip(&surface).enumerate() {
            let is_kept = (at / GRID.width).is_multiple_of(2) && (at % GRID.width).is_multiple_of(2);
            assert!(!is_kept || back.is_valid() == vertex.is_valid());
        }
    }

    #[test]
    fn other_bytes_are_an_error() {
        let packed = pack(GRID, &surface(10));
        assert!(unpack(GRID, &packed[..packed.len() - 1]).is_err());
        assert!(unpack(GRID, &[packed.as_slice(), &[0]].concat()).is_err());
        assert!(unpack(Grid { width: 51, ..GRID }, &packed).is_err());
        assert!(unpack(GRID, &[]).is_err());
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
