//! Structure-of-arrays storage of one surface while it is being made.

use crate::vertex::Grid;

/// Three coordinates, each in an array of its own.
#[derive(Clone, Debug, Default)]
pub(crate) struct Planes3 {
    pub(crate) x: Vec<f32>,
    pub(crate) y: Vec<f32>,
    pub(crate) z: Vec<f32>,
}

impl Planes3 {
    pub(crate) fn zeros(len: usize) -> Self {
        Self { x: vec![0.0; len], y: vec![0.0; len], z: vec![0.0; len] }
    }

    #[inline]
    pub(crate) fn at(&self, i: usize) -> [f32; 3] {
        [self.x[i], self.y[i], self.z[i]]
    }

    #[inline]
    pub(crate) fn set(&mut self, i: usize, [x, y, z]: [f32; 3]) {
        self.x[i] = x;
        self.y[i] = y;
        self.z[i] = z;
    }
}

/// All that is kept between the steps of one reconstruction; reused from frame to frame.
#[derive(Debug)]
pub(crate) struct Workspace {
    pub(crate) grid: Grid,
    /// Points; `z == 0` where there is no measurement.
    pub(crate) points: Planes3,
    /// Brightness in `[0, 1]`.
    pub(crate) intensity: Vec<f32>,
    /// Red, green, blue and the row offset inside the cell.
    pub(crate) colour_row: Vec<[u8; 4]>,
    /// Edge and quad bits of [`crate::mesh`].
    pub(crate) bits: Vec<u8>,
    /// Quads around each vertex.
    pub(crate) quads: Vec<u8>,
    /// Unit normals; zero where there is none.
    pub(crate) normals: Planes3,
    pub(crate) filtered_points: Planes3,
    pub(crate) filtered_normals: Planes3,
    /// Normal of the quad whose upper left corner is the vertex, not normalised.
    pub(crate) quad_normals: Planes3,
    /// Filter weights of the three forward edges.
    pub(crate) edge_weights: [Vec<f32>; 3],
}

impl Workspace {
    pub(crate) fn new(grid: Grid) -> Self {
        let len = grid.len();
        Self {
            grid,
            points: Planes3::zeros(len),
            intensity: vec![0.0; len],
            colour_row: vec![[0; 4]; len],
            bits: vec![0; len],
            quads: vec![0; len],
            normals: Planes3::zeros(len),
            filtered_points: Planes3::zeros(len),
            filtered_normals: Planes3::zeros(len),
            quad_normals: Planes3::zeros(len),
            edge_weights: [vec![0.0; len], vec![0.0; len], vec![0.0; len]],
        }
    }
}
