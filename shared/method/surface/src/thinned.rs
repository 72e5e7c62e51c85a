//! Surfaces for a narrow link: each n-th vertex of each n-th row, rounded to a fraction of the sensor's
//! noise and predicted from those above and to the left; the vertices between are interpolated by the reader.
//!
//! Each vertex is slid along its tangent plane to the ray of its place in the grid, so that its depth says where it
//! is. Depth is rounded as its inverse, in which the noise of a depth camera is about the same at all distances,
//! by steps that the bytes tell ([`Thinning`]), normals likewise, colours to an eighth of their range. Residuals go
//! through a range coder whose probabilities follow the residuals around. Vertices at places that the caller names
//! are kept too. What [`unpack`] returns is a function of the bytes and these places alone.

mod beside;

use crate::octahedron::{from_normal_by, round, to_normal_by};
use crate::packed::{UnpackError, predict_row};
use crate::thinned::beside::BetweenVertices;
use crate::vertex::{Grid, Vertex};
use tessera_numerics::{BitCoder, BitModel, NumberModel, RangeReader, RangeWriter};

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

/// Rounding of colours, of 256 levels.
const COLOUR_STEP: i32 = 32;
/// A vertex whose depth would change by more than this part on its way along the tangent plane keeps it.
const MOST_SLIDE: f32 = 0.03;
/// Bits of [`Vertex::flags_rgb`] that are no colour.
const FLAGS: u32 = 0xff;
/// Numbers of a vertex: inverse depth, normal on the octahedron, green, and red and blue less green. Only valid
/// vertices have any.
const NUMBERS: usize = 6;
/// Farthest two kept vertices may be from each other's tangent planes for others to stand between them, as part
/// of their depth and for each place from one to the other.
const MOST_BEND: f32 = 0.005;

/// Packs the vertices of a grid, row by row, and behind them those `beside` the kept ones, by their places in the
/// grid.
///
/// # Panics
/// Where `vertices` are not as many as the grid has, or the thinning is none.
pub fn pack(grid: Grid, vertices: &[Vertex], beside: &[usize], thinning: Thinning) -> Vec<u8> {
    assert_eq!(vertices.len(), grid.len(), "vertices of the grid");
    assert_eq!(Thinning::read(thinning.bytes()), Some(thinning), "a thinning");
    let rays = Rays::of(grid, vertices);
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
    /// Writes the vertices `own`, or reads them: what a reader has of them. `None` where a vertex has no depth.
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
        interpolate(grid, step, &mut vertices);
        let mut others = BetweenVertices::new(grid, rays, thinning);
        let is_between = |place: usize| {
            !((place / grid.width).is_multiple_of(step) && (place % grid.width).is_multiple_of(step))
        };
        let mut told = Vec::new();
        for place in beside.iter().copied().filter(|place| *place < grid.len() && is_between(*place)) {
            let own = own.map(|own| &own[place]);
            told.extend(others.code(coder, (&vertices, place), own).map(|vertex| (place, vertex)));
        }
        told.into_iter().for_each(|(place, vertex)| vertices[place] = vertex);
        Some(vertices)
    }
}

/// The place of the kept vertex nearest to a row and a column.
fn nearest_kept(grid: Grid, thinning: Thinning, row: usize, column: usize) -> usize {
    let ((width, height), step) = (thinning.kept(grid), thinning.step());
    let nearest = |at: usize, n: usize| ((at + step / 2) / step).min(n - 1) * step;
    nearest(row, height) * grid.width + nearest(column, width)
}

/// Fills in the vertices between the kept ones: first those of the kept rows, then the rows between.
fn interpolate(grid: Grid, step: usize, vertices: &mut [Vertex]) {
    let Grid { width, height, .. } = grid;
    for row in (0..height).step_by(step) {
        for from in (0..width.saturating_sub(step)).step_by(step) {
            let ends = [0, step].map(|more| vertices[row * width + from + more]);
            for place in 1..step {
                vertices[row * width + from + place] = between(&ends, place, step);
            }
        }
    }
    for from in (0..height.saturating_sub(step)).step_by(step) {
        for column in 0..width {
            let ends = [0, step].map(|more| vertices[(from + more) * width + column]);
            for place in 1..step {
                vertices[(from + place) * width + column] = between(&ends, place, step);
            }
        }
    }
}

/// The vertex between two, at `place` of `step` from the first to the second, where both are of one smooth
/// surface.
fn between([a, b]: &[Vertex; 2], place: usize, step: usize) -> Vertex {
    if !(a.is_valid() && b.is_valid()) {
        return Vertex::default();
    }
    let offset: [f32; 3] = std::array::from_fn(|k| b.position[k] - a.position[k]);
    let off_plane = |normal: [f32; 3]| (0..3).map(|k| normal[k] * offset[k]).sum::<f32>().abs();
    let most_m = MOST_BEND * step as f32 * a.position[2].min(b.position[2]);
    let length_of = |v: [f32; 3]| v.iter().map(|v| v * v).sum::<f32>().sqrt();
    let sum: [f32; 3] = std::array::from_fn(|k| a.normal[k] + b.normal[k]);
    // Normals of more than 90 degrees between them are no smooth surface.
    let is_smooth = off_plane(a.normal).max(off_plane(b.normal)) <= most_m && length_of(sum) >= 1.5;
    if !is_smooth {
        return Vertex::default();
    }
    let share = place as f32 / step as f32;
    let mix = |a: f32, b: f32| a + share * (b - a);
    let normal: [f32; 3] = std::array::from_fn(|k| mix(a.normal[k], b.normal[k]));
    let length = length_of(normal);
    let rgb = std::array::from_fn(|k| mix(a.rgb()[k].into(), b.rgb()[k].into()) as u8);
    let is_boundary = !a.is_inner() && !b.is_inner();
    let flags = Vertex::VALID | if is_boundary { Vertex::BOUNDARY } else { 0 };
    Vertex {
        position: std::array::from_fn(|k| a.position[k] + share * offset[k]),
        flags_rgb: Vertex::pack(flags, (a.row_offset() + b.row_offset()) / 2, rgb),
        normal: normal.map(|v| v / length),
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
    thinning: Thinning,
    flags: Vec<u32>,
    flags_above: Vec<u32>,
    current: [Vec<i32>; NUMBERS],
    above: [Vec<i32>; NUMBERS],
    missed: [Vec<u32>; NUMBERS],
    missed_above: [Vec<u32>; NUMBERS],
}

impl ThinnedRows {
    fn new(width: usize, thinning: Thinning) -> Self {
        let zeros = || std::array::from_fn(|_| vec![0; width]);
        let [missed, missed_above] = std::array::from_fn(|_| std::array::from_fn(|_| vec![0; width]));
        let [flags, flags_above] = std::array::from_fn(|_| vec![0; width]);
        Self { thinning, flags, flags_above, current: zeros(), above: zeros(), missed, missed_above }
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
        let rounded = RoundedVertex::of(self.thinning, vertex, depth_m).unwrap_or_default();
        self.flags[column] = rounded.flags;
        if rounded.is_valid() {
            for (row, number) in self.current.iter_mut().zip(rounded.numbers) {
                row[column] = number;
            }
        }
    }

    /// The vertex of rounded numbers; `None` where there is none of that depth.
    fn vertex(&self, column: usize, ray: [f32; 3]) -> Option<Vertex> {
        let numbers: [i32; NUMBERS] = std::array::from_fn(|number| self.current[number][column]);
        RoundedVertex { flags: self.flags[column], numbers }.vertex(self.thinning, ray)
    }
}

/// A vertex by its numbers, see [`NUMBERS`].
#[derive(Clone, Copy, Debug, Default)]
struct RoundedVertex {
    flags: u32,
    numbers: [i32; NUMBERS],
}

impl RoundedVertex {
    /// A vertex that stands at this depth; `None` where it is none.
    fn of(thinning: Thinning, vertex: &Vertex, depth_m: f32) -> Option<Self> {
        let inverse = round(1.0 / depth_m / thinning.depth_step());
        if !(vertex.is_valid() && depth_m > 0.0 && inverse > 0) {
            return None;
        }
        let [u, v] = from_normal_by(thinning.normal_steps.into(), vertex.normal);
        let [red, green, blue] = vertex.rgb().map(|value| i32::from(value) / COLOUR_STEP);
        let numbers = [inverse, u, v, green, red - green, blue - green];
        Some(Self { flags: vertex.flags_rgb & FLAGS, numbers })
    }

    fn is_valid(&self) -> bool {
        is_valid(self.flags)
    }

    fn some_valid(self) -> Option<Self> {
        self.is_valid().then_some(self)
    }

    /// The vertex on a ray; `None` where there is none of that depth.
    fn vertex(&self, thinning: Thinning, ray: [f32; 3]) -> Option<Vertex> {
        if !self.is_valid() {
            return Some(Vertex::default());
        }
        let [inverse, u, v, green, red, blue] = self.numbers;
        let depth_m = 1.0 / (inverse as f32 * thinning.depth_step());
        let middle = |value: i32| (value.clamp(0, 255 / COLOUR_STEP) * COLOUR_STEP + COLOUR_STEP / 2) as u8;
        let rgb = [red.wrapping_add(green), green, blue.wrapping_add(green)];
        (inverse > 0).then(|| Vertex {
            position: ray.map(|v| v * depth_m),
            flags_rgb: Vertex::pack(0, 0, rgb.map(middle)) | (self.flags & FLAGS),
            normal: to_normal_by(thinning.normal_steps.into(), [u, v]),
            reserved: 0,
        })
    }
}

#[cfg(test)]
mod tests;
