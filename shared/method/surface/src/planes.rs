//! Structure-of-arrays storage of one surface while it is being made.
//!
//! Planes are padded by one cell on each side, so that a loop over a row may read all neighbours
//! without asking where the image ends: the padding holds no measurement and no edge.

use crate::vertex::Grid;

/// Where a grid lies in a padded plane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaneLayout {
    pub(crate) grid: Grid,
    pub(crate) stride: usize,
}

impl PlaneLayout {
    pub(crate) fn new(grid: Grid) -> Self {
        Self { grid, stride: grid.width + 2 }
    }

    /// Length of a padded plane.
    pub(crate) fn len(&self) -> usize {
        self.stride * (self.grid.height + 2)
    }

    /// Place of the first vertex of a row.
    #[inline(always)]
    pub(crate) fn row(&self, row: usize) -> usize {
        (row + 1) * self.stride + 1
    }
}

/// Three coordinates, each in a padded plane of its own.
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

    #[inline(always)]
    pub(crate) fn at(&self, i: usize) -> [f32; 3] {
        [self.x[i], self.y[i], self.z[i]]
    }

    pub(crate) fn set(&mut self, i: usize, [x, y, z]: [f32; 3]) {
        (self.x[i], self.y[i], self.z[i]) = (x, y, z);
    }

    /// The three runs of `n` values from `start`.
    #[inline(always)]
    pub(crate) fn run(&self, start: usize, n: usize) -> PlaneRun<'_> {
        PlaneRun { x: &self.x[start..start + n], y: &self.y[start..start + n], z: &self.z[start..start + n] }
    }

    /// The three runs of `n` values from `start`, to write.
    #[inline(always)]
    pub(crate) fn run_mut(&mut self, start: usize, n: usize) -> [&mut [f32]; 3] {
        [&mut self.x[start..start + n], &mut self.y[start..start + n], &mut self.z[start..start + n]]
    }
}

/// A run of points or normals along a row.
#[derive(Clone, Copy)]
pub(crate) struct PlaneRun<'a> {
    pub(crate) x: &'a [f32],
    pub(crate) y: &'a [f32],
    pub(crate) z: &'a [f32],
}

impl<'a> PlaneRun<'a> {
    /// The first `n`, so that the compiler sees one length for all.
    #[inline(always)]
    pub(crate) fn first(self, n: usize) -> Self {
        Self { x: &self.x[..n], y: &self.y[..n], z: &self.z[..n] }
    }

    #[inline(always)]
    pub(crate) fn at(&self, i: usize) -> [f32; 3] {
        [self.x[i], self.y[i], self.z[i]]
    }
}

/// Edges and quads as factors: 1 where there is one, 0 where there is none.
#[derive(Clone, Debug)]
pub(crate) struct QuadMesh {
    pub(crate) right: Vec<f32>,
    pub(crate) down: Vec<f32>,
    pub(crate) diagonal: Vec<f32>,
    /// The quad whose upper left corner is the vertex.
    pub(crate) quad: Vec<f32>,
    /// Quads around the vertex, 0 to 4.
    pub(crate) n_quads: Vec<f32>,
}

/// All that is kept between the steps of one reconstruction; reused from frame to frame.
#[derive(Debug)]
pub(crate) struct Workspace {
    pub(crate) layout: PlaneLayout,
    /// Points; `z == 0` where there is no measurement.
    pub(crate) points: Planes3,
    /// Brightness in `[0, 1]`.
    pub(crate) intensity: Vec<f32>,
    /// Red, green, blue and the row offset inside the cell; not padded.
    pub(crate) colour_row: Vec<[u8; 4]>,
    /// Flags, row offset and colour of the vertices of one row, packed.
    pub(crate) flags_rgb: Vec<u32>,
    pub(crate) mesh: QuadMesh,
    /// Unit normals; zero where there is none.
    pub(crate) normals: Planes3,
    pub(crate) filtered_points: Planes3,
    pub(crate) filtered_normals: Planes3,
    /// Normal of each quad, not normalised.
    pub(crate) quad_normals: Planes3,
    /// Filter weights of the edges to the right, below and to the lower right.
    pub(crate) weights: [Vec<f32>; 3],
    /// The filter's sums along one row.
    pub(crate) sums: RowSums,
}

/// Weighted sums along one row: weight, point and normal of eq. 6.
#[derive(Clone, Debug)]
pub(crate) struct RowSums {
    pub(crate) weight: Vec<f32>,
    pub(crate) point: Planes3,
    pub(crate) normal: Planes3,
}

impl Workspace {
    pub(crate) fn new(grid: Grid) -> Self {
        let layout = PlaneLayout::new(grid);
        let len = layout.len();
        let plane = || vec![0.0; len];
        Self {
            layout,
            points: Planes3::zeros(len),
            intensity: plane(),
            colour_row: vec![[0; 4]; grid.len()],
            flags_rgb: vec![0; grid.width],
            mesh: QuadMesh {
                right: plane(),
                down: plane(),
                diagonal: plane(),
                quad: plane(),
                n_quads: plane(),
            },
            normals: Planes3::zeros(len),
            filtered_points: Planes3::zeros(len),
            filtered_normals: Planes3::zeros(len),
            quad_normals: Planes3::zeros(len),
            weights: [plane(), plane(), plane()],
            sums: RowSums {
                weight: vec![0.0; grid.width],
                point: Planes3::zeros(grid.width),
                normal: Planes3::zeros(grid.width),
            },
        }
    }
}
