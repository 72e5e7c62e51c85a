//! The kept vertices, and those between them, as a reader fills them in.

use crate::vertex::{Grid, Vertex};

/// Farthest two kept vertices may be from each other's tangent planes for others to stand between them, as part
/// of their depth and for each place from one to the other.
const MOST_BEND: f32 = 0.005;

/// Each `step`-th vertex of each `step`-th row of a grid.
pub(super) struct KeptVertices {
    grid: Grid,
    step: usize,
    vertices: Vec<Vertex>,
}

impl KeptVertices {
    pub(super) fn new(grid: Grid, step: usize) -> Self {
        let n = grid.width.div_ceil(step) * grid.height.div_ceil(step);
        Self { grid, step, vertices: vec![Vertex::default(); n] }
    }

    /// Those of all vertices of a grid.
    pub(super) fn of(grid: Grid, step: usize, vertex_at: impl Fn(usize) -> Vertex) -> Self {
        let mut kept = Self::new(grid, step);
        for row in 0..kept.height() {
            for column in 0..kept.width() {
                *kept.at_mut(row, column) = vertex_at(row * step * grid.width + column * step);
            }
        }
        kept
    }

    /// Vertices in a row.
    pub(super) fn width(&self) -> usize {
        self.grid.width.div_ceil(self.step)
    }

    /// Rows.
    pub(super) fn height(&self) -> usize {
        self.grid.height.div_ceil(self.step)
    }

    /// From one row or column of the grid to the next.
    pub(super) fn step(&self) -> usize {
        self.step
    }

    pub(super) fn at(&self, row: usize, column: usize) -> &Vertex {
        &self.vertices[row * self.width() + column]
    }

    pub(super) fn at_mut(&mut self, row: usize, column: usize) -> &mut Vertex {
        let width = self.width();
        &mut self.vertices[row * width + column]
    }

    /// The one nearest to a place of the grid.
    pub(super) fn nearest(&self, place: usize) -> Vertex {
        let nearest = |at: usize, n: usize| ((at + self.step / 2) / self.step).min(n - 1);
        let (row, column) = (place / self.grid.width, place % self.grid.width);
        *self.at(nearest(row, self.height()), nearest(column, self.width()))
    }

    /// The whole grid: between the kept vertices of a kept row, then between the kept rows.
    pub(super) fn spread(&self) -> Vec<Vertex> {
        let Self { grid: Grid { width, height, .. }, step, .. } = *self;
        let mut vertices = vec![Vertex::default(); self.grid.len()];
        for row in 0..self.height() {
            let line = &mut vertices[row * step * width..][..width];
            for column in 0..self.width() {
                line[column * step] = *self.at(row, column);
            }
            for from in (0..width.saturating_sub(step)).step_by(step) {
                let ends = [line[from], line[from + step]];
                for place in 1..step {
                    line[from + place] = between(&ends, place, step);
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
        vertices
    }

    /// What [`Self::spread`] has at one place.
    pub(super) fn interpolated(&self, place: usize) -> Vertex {
        let step = self.step;
        let (row, column) = (place / self.grid.width, place % self.grid.width);
        let of_row = |row: usize| match column % step {
            0 => *self.at(row, column / step),
            _ if column / step + 1 >= self.width() => Vertex::default(),
            place => between(&[0, 1].map(|more| *self.at(row, column / step + more)), place, step),
        };
        match row % step {
            0 => of_row(row / step),
            _ if row / step + 1 >= self.height() => Vertex::default(),
            place => between(&[0, 1].map(|more| of_row(row / step + more)), place, step),
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
