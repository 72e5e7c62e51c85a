//! Vertices as integers.

use crate::octahedron;
use crate::vertex::Vertex;

/// Rounding of the coordinates of a point, metres.
pub(super) const POINT_STEP_M: f32 = 1.0 / 8192.0;
/// Bits of [`Vertex::flags_rgb`] that are no colour.
const FLAGS: u32 = 0xff;
/// Flag of a vertex with a measurement, above the flags of [`Vertex`].
const MEASURED: u32 = 0x100;
/// All flags of a rounded vertex.
pub(super) const ALL_FLAGS: u32 = FLAGS | MEASURED;

/// Numbers of a vertex, in their order in a row, each with the flag of the vertices that have it
/// (0: all). A point's depth, column and row coordinates, the normal on the octahedron, green, and
/// red and blue less green.
pub(super) const NUMBERS: [u32; 8] = [MEASURED, MEASURED, MEASURED, Vertex::VALID, Vertex::VALID, 0, 0, 0];

/// Whether all bits of `flag` are set.
#[inline]
pub(super) fn has(flags: u32, flag: u32) -> bool {
    flags & flag == flag
}

/// Vertices that are rounded at a time.
const RUN: usize = 16;

/// Vertices as integers, number by number.
pub(super) struct Rounded {
    pub flags: Vec<u32>,
    pub numbers: [Vec<i32>; NUMBERS.len()],
}

impl Rounded {
    pub(super) fn new(n: usize) -> Self {
        Self { flags: vec![0; n], numbers: std::array::from_fn(|_| vec![0; n]) }
    }

    /// Rounds vertices into its first places.
    pub(super) fn set_all<'a>(&mut self, vertices: impl ExactSizeIterator<Item = &'a Vertex>) {
        pulp::Arch::new().dispatch(SetAll { rounded: self, vertices });
    }

    /// Appends the vertices of the first `n` places.
    pub(super) fn append_to(&self, n: usize, vertices: &mut Vec<Vertex>) {
        pulp::Arch::new().dispatch(AppendTo { rounded: self, n, vertices });
    }

    #[inline(always)]
    fn set(&mut self, at: usize, vertices: &[Vertex; RUN], n: usize) {
        let (mut flags, mut numbers) = ([0; RUN], [[0; RUN]; NUMBERS.len()]);
        // By coordinate: what is next to each other is rounded together.
        let (mut point, mut normal) = ([[0.0; RUN]; 3], [[0.0; RUN]; 3]);
        for (k, vertex) in vertices.iter().enumerate() {
            (0..3).for_each(|c| (point[c][k], normal[c][k]) = (vertex.position[c], vertex.normal[c]));
            let is_measured = vertex.position != [0.0; 3];
            flags[k] = (vertex.flags_rgb & FLAGS) | if is_measured { MEASURED } else { 0 };
            let [red, green, blue] = vertex.rgb().map(i32::from);
            (numbers[5][k], numbers[6][k], numbers[7][k]) = (green, red - green, blue - green);
        }
        (numbers[0], numbers[1], numbers[2]) =
            (in_steps(&point[2]), in_steps(&point[0]), in_steps(&point[1]));
        for k in 0..RUN {
            let place = octahedron::from_normal([normal[0][k], normal[1][k], normal[2][k]]);
            (numbers[3][k], numbers[4][k]) = (place[0], place[1]);
        }
        self.flags[at..at + n].copy_from_slice(&flags[..n]);
        for (row, numbers) in self.numbers.iter_mut().zip(&numbers) {
            row[at..at + n].copy_from_slice(&numbers[..n]);
        }
    }

    /// The vertices of rounded numbers from `at` on: the first `n` of a run.
    #[inline(always)]
    fn run(&self, at: usize, n: usize) -> [Vertex; RUN] {
        let mut numbers = [[0; RUN]; NUMBERS.len()];
        for (run, row) in numbers.iter_mut().zip(&self.numbers) {
            run[..n].copy_from_slice(&row[at..at + n]);
        }
        let mut normals = [[0.0; RUN]; 3];
        for k in 0..RUN {
            let normal = octahedron::to_normal([numbers[3][k], numbers[4][k]]);
            (normals[0][k], normals[1][k], normals[2][k]) = (normal[0], normal[1], normal[2]);
        }
        let mut vertices = [Vertex::default(); RUN];
        for (k, (vertex, flags)) in vertices.iter_mut().zip(&self.flags[at..at + n]).enumerate() {
            let of_vertex = std::array::from_fn(|number| numbers[number][k]);
            *vertex = vertex_of(*flags, of_vertex, std::array::from_fn(|axis| normals[axis][k]));
        }
        vertices
    }

    /// The vertex of rounded numbers.
    pub(super) fn vertex(&self, at: usize) -> Vertex {
        self.run(at, 1)[0]
    }
}

#[inline(always)]
fn in_steps(metres: &[f32; RUN]) -> [i32; RUN] {
    let mut steps = [0; RUN];
    for k in 0..RUN {
        steps[k] = octahedron::round(metres[k] / POINT_STEP_M);
    }
    steps
}

#[inline(always)]
fn vertex_of(flags: u32, numbers: [i32; NUMBERS.len()], normal: [f32; 3]) -> Vertex {
    let [z, x, y, _, _, green, red, blue] = numbers;
    let position = [x, y, z].map(|steps| steps as f32 * POINT_STEP_M);
    let rgb = [red.wrapping_add(green), green, blue.wrapping_add(green)].map(|value| value as u8);
    Vertex {
        position: if has(flags, MEASURED) { position } else { [0.0; 3] },
        flags_rgb: Vertex::pack(0, 0, rgb) | (flags & FLAGS),
        normal: if has(flags, Vertex::VALID) { normal } else { [0.0; 3] },
        reserved: 0,
    }
}

/// [`Rounded::set_all`], compiled for each instruction set; plain arithmetic, the same bits with all.
struct SetAll<'r, V> {
    rounded: &'r mut Rounded,
    vertices: V,
}

impl<'a, V: ExactSizeIterator<Item = &'a Vertex>> pulp::WithSimd for SetAll<'_, V> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let Self { rounded, mut vertices } = self;
        let mut run = [Vertex::default(); RUN];
        for at in (0..vertices.len()).step_by(RUN) {
            let n = vertices.len().min(RUN);
            run.iter_mut().zip(vertices.by_ref()).for_each(|(copy, vertex)| *copy = *vertex);
            rounded.set(at, &run, n);
        }
    }
}

/// [`Rounded::append_to`], compiled for each instruction set.
struct AppendTo<'r, 'v> {
    rounded: &'r Rounded,
    n: usize,
    vertices: &'v mut Vec<Vertex>,
}

impl pulp::WithSimd for AppendTo<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let Self { rounded, n: all, vertices } = self;
        for at in (0..all).step_by(RUN) {
            let n = RUN.min(all - at);
            vertices.extend_from_slice(&rounded.run(at, n)[..n]);
        }
    }
}
