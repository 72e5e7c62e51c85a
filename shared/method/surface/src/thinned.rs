//! Surfaces for a narrow link: each second vertex of each second row, rounded to a fraction of the sensor's
//! noise and predicted from those above and to the left; the vertices between are interpolated by the reader.
//!
//! Each vertex is slid along its tangent plane to the ray of its place in the grid, so that its depth says where it
//! is. Depth is rounded as its inverse, in which the noise of a depth camera is about the same at all distances,
//! by steps that the bytes tell ([`Rounding`]), normals likewise, colours to an eighth of their range. Residuals go
//! through a range coder whose probabilities follow the residuals around. What [`unpack`] returns is a function of
//! the bytes alone.

use crate::octahedron::{from_normal_by, round, to_normal_by};
use crate::packed::{UnpackError, predict_row};
use crate::vertex::{Grid, Vertex};
use tessera_numerics::{BitCoder, BitModel, NumberModel, RangeReader, RangeWriter};

/// By what depth and normals are rounded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rounding {
    /// Steps of the inverse of depth, per 1/m, at least 1: 4096 are 1 mm at 2 m, an eighth of the noise (eq. 5).
    pub inverse_depth_steps: u16,
    /// Steps of a normal from the centre of the octahedral map to its border, at least 1: 31 are 2 degrees.
    pub normal_steps: u8,
}

impl Rounding {
    fn depth_step(self) -> f32 {
        1.0 / f32::from(self.inverse_depth_steps)
    }
}

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
pub fn pack(grid: Grid, vertices: &[Vertex], rounding: Rounding) -> Vec<u8> {
    assert_eq!(vertices.len(), grid.len(), "vertices of the grid");
    let rays = Rays::of(grid, vertices);
    let mut rows = ThinnedRows::new(kept(grid).0, rounding);
    let (mut writer, mut models) = (RangeWriter::default(), Models::default());
    for (row, line) in vertices.chunks_exact(grid.width).enumerate().step_by(2) {
        rows.next();
        for (column, vertex) in line.iter().enumerate().step_by(2) {
            rows.set(column / 2, vertex, rays.depth_m(vertex, rays.at(row, column)));
        }
        rows.code(&mut writer, &mut models);
    }
    let [a, b, c, d] = rays.0.map(f32::to_le_bytes);
    let [low, high] = rounding.inverse_depth_steps.to_le_bytes();
    [a.as_slice(), &b, &c, &d, &[low, high, rounding.normal_steps], &writer.finish()].concat()
}

/// The vertices of a packed surface, row by row, those between the kept ones interpolated.
///
/// # Errors
/// Where the bytes are not of a surface of this grid.
pub fn unpack(grid: Grid, bytes: &[u8]) -> Result<Vec<Vertex>, UnpackError> {
    let error = UnpackError { width: grid.width, height: grid.height };
    let (width, height) = kept(grid);
    let (rays, bytes) = Rays::read(bytes).ok_or(error)?;
    let (&[low, high, normal_steps], bytes) = bytes.split_first_chunk::<3>().ok_or(error)?;
    let rounding = Rounding { inverse_depth_steps: u16::from_le_bytes([low, high]), normal_steps };
    if rounding.inverse_depth_steps == 0 || normal_steps == 0 {
        return Err(error);
    }
    let mut rows = ThinnedRows::new(width, rounding);
    let (mut reader, mut models) = (RangeReader::new(bytes), Models::default());
    let mut vertices = vec![Vertex::default(); grid.len()];
    for row in 0..height {
        rows.next();
        rows.code(&mut reader, &mut models);
        let line = &mut vertices[2 * row * grid.width..][..grid.width];
        for (column, vertex) in line.iter_mut().step_by(2).enumerate() {
            *vertex = rows.vertex(column, rays.at(2 * row, 2 * column)).ok_or(error)?;
        }
    }
    if !reader.ends() {
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

/// What was learnt of the numbers of vertices, by how well those around were predicted.
struct Models {
    numbers: Vec<[NumberModel; SURPRISES * OTHERS]>,
    /// Whether the flags are those to the left; or else those above.
    is_left: [BitModel; 8],
    is_above: BitModel,
    flags: NumberModel,
}

/// Classes of the residuals around, and of that of another number of the same vertex.
const SURPRISES: usize = 10;
const OTHERS: usize = 4;

impl Default for Models {
    fn default() -> Self {
        let model = || std::array::from_fn(|_| NumberModel::default());
        let (is_left, is_above) = Default::default();
        Self {
            numbers: (0..NUMBERS).map(|_| model()).collect(),
            is_left,
            is_above,
            flags: NumberModel::default(),
        }
    }
}

impl Models {
    /// Flags, predicted from those to the left, above, and above to the left.
    fn flags(&mut self, coder: &mut impl BitCoder, flags: u32, [left, above, corner]: [u32; 3]) -> u32 {
        let same = [left == above, above == corner, is_valid(left)];
        let class = same.iter().fold(0, |sum, &is| 2 * sum + usize::from(is));
        if coder.bit(&mut self.is_left[class], flags == left) {
            return left;
        }
        if above != left && coder.bit(&mut self.is_above, flags == above) {
            return above;
        }
        left ^ self.flags.magnitude(coder, flags ^ left)
    }

    /// A residual, where those around sum to `around` and another one of the vertex is `other`.
    fn residual(
        &mut self,
        coder: &mut impl BitCoder,
        number: usize,
        value: i32,
        [around, other]: [u32; 2],
    ) -> i32 {
        let surprise = match around {
            0..=2 => around as usize,
            3..=4 => 3,
            5..=6 => 4,
            7..=9 => 5,
            10..=14 => 6,
            15..=22 => 7,
            23..=40 => 8,
            _ => 9,
        };
        let other = (other as usize).min(OTHERS - 1);
        self.numbers[number][OTHERS * surprise + other].signed(coder, value)
    }
}

/// The row in work and the one above it, as integers, with how far each was from its prediction.
struct ThinnedRows {
    rounding: Rounding,
    flags: Vec<u32>,
    flags_above: Vec<u32>,
    current: [Vec<i32>; NUMBERS],
    above: [Vec<i32>; NUMBERS],
    missed: [Vec<u32>; NUMBERS],
    missed_above: [Vec<u32>; NUMBERS],
}

impl ThinnedRows {
    fn new(width: usize, rounding: Rounding) -> Self {
        let zeros = || std::array::from_fn(|_| vec![0; width]);
        let [missed, missed_above] = std::array::from_fn(|_| std::array::from_fn(|_| vec![0; width]));
        let [flags, flags_above] = std::array::from_fn(|_| vec![0; width]);
        Self { rounding, flags, flags_above, current: zeros(), above: zeros(), missed, missed_above }
    }

    fn next(&mut self) {
        std::mem::swap(&mut self.current, &mut self.above);
        std::mem::swap(&mut self.missed, &mut self.missed_above);
        std::mem::swap(&mut self.flags, &mut self.flags_above);
    }

    /// Writes the row, or reads it.
    fn code(&mut self, coder: &mut impl BitCoder, models: &mut Models) {
        let (mut left, mut corner) = (0, 0);
        for (flags, &above) in self.flags.iter_mut().zip(&self.flags_above) {
            *flags = models.flags(coder, *flags, [left, above, corner]);
            (left, corner) = (*flags, above);
        }
        for number in 0..NUMBERS {
            self.code_number(coder, models, number);
        }
    }

    fn code_number(&mut self, coder: &mut impl BitCoder, models: &mut Models, number: usize) {
        // Which number of the same vertex says how hard this one is to predict.
        let (before, this) = self.missed.split_at_mut(number);
        let (missed, above) = (&mut this[0], &self.missed_above[number]);
        let other = |column: usize| match number {
            1 => before[0][column] / 3,
            2 => before[1][column],
            4 => before[3][column],
            5 => before[3][column].saturating_add(before[4][column]),
            _ => 0,
        };
        let mut columns = 0..;
        let width = self.flags.len();
        let flags = &self.flags;
        predict_row(
            &mut self.current[number],
            &self.above[number],
            flags,
            |_| true,
            |value, prediction| {
                let at: usize = columns.next().unwrap_or(0);
                if !is_valid(flags[at]) {
                    missed[at] = 0;
                    return prediction;
                }
                let left = if at > 0 { missed[at - 1] } else { 0 };
                let (corner, right) = (above[at.saturating_sub(1)], above[(at + 1).min(width - 1)]);
                let around = [left, left, above[at], above[at], corner, right];
                let around = around.iter().fold(0, |sum: u32, &v| sum.saturating_add(v));
                let residual = value.wrapping_sub(prediction);
                let residual = models.residual(coder, number, residual, [around, other(at)]);
                missed[at] = residual.unsigned_abs();
                prediction.wrapping_add(residual)
            },
        );
    }

    /// Rounds a vertex.
    fn set(&mut self, column: usize, vertex: &Vertex, depth_m: f32) {
        let inverse = round(1.0 / depth_m / self.rounding.depth_step());
        let is_usable = vertex.is_valid() && depth_m > 0.0 && inverse > 0;
        self.flags[column] = if is_usable { vertex.flags_rgb & FLAGS } else { 0 };
        if !is_usable {
            return;
        }
        let [u, v] = from_normal_by(self.rounding.normal_steps.into(), vertex.normal);
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
        let depth_m = 1.0 / (inverse as f32 * self.rounding.depth_step());
        let middle = |value: i32| (value.clamp(0, 255 / COLOUR_STEP) * COLOUR_STEP + COLOUR_STEP / 2) as u8;
        let rgb = [red.wrapping_add(green), green, blue.wrapping_add(green)];
        (inverse > 0).then(|| Vertex {
            position: ray.map(|v| v * depth_m),
            flags_rgb: Vertex::pack(0, 0, rgb.map(middle)) | (flags & FLAGS),
            normal: to_normal_by(self.rounding.normal_steps.into(), [u, v]),
            reserved: 0,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    const GRID: Grid = Grid { width: 41, height: 30, step: 4 };
    const FINE: Rounding = Rounding { inverse_depth_steps: 4096, normal_steps: 31 };

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
        let bytes = pack(GRID, &surface, FINE);
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
        let bytes = pack(GRID, &vec![Vertex::default(); GRID.len()], FINE);
        assert_eq!(unpack(GRID, &bytes).unwrap(), vec![Vertex::default(); GRID.len()]);
        let surface = surface(4);
        let back = unpack(GRID, &pack(GRID, &surface, FINE)).unwrap();
        for (at, (back, vertex)) in back.iter().zip(&surface).enumerate() {
            let is_kept = (at / GRID.width).is_multiple_of(2) && (at % GRID.width).is_multiple_of(2);
            assert!(!is_kept || back.is_valid() == vertex.is_valid());
        }
    }

    #[test]
    fn other_bytes_are_an_error() {
        let packed = pack(GRID, &surface(10), FINE);
        assert!(unpack(GRID, &packed[..packed.len() - 1]).is_err());
        assert!(unpack(GRID, &[packed.as_slice(), &[0]].concat()).is_err());
        assert!(unpack(Grid { width: 51, ..GRID }, &packed).is_err());
        assert!(unpack(GRID, &[]).is_err());
        // No steps at all.
        let stepless = [&packed[..16], &[0, 0, 31], &packed[19..]].concat();
        assert!(unpack(GRID, &stepless).is_err());
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
