//! A whole surface of its first vertices: those between them are interpolated.

use super::FIRST_SPACING;
use super::first::FirstVertices;
use crate::vertex::Vertex;

/// Farthest two vertices may be from each other's tangent planes for others to stand between them, as part of
/// their depth and for each place from one to the other.
const MOST_BEND: f32 = 0.005;

impl FirstVertices {
    /// The whole grid: between the spaced vertices of a row, then between these rows; and those beside as they are.
    pub(super) fn spread(&self) -> Vec<Vertex> {
        let (grid, step) = (self.grid(), usize::from(FIRST_SPACING));
        let (width, height) = (grid.width, grid.height);
        let mut vertices = vec![Vertex::default(); grid.len()];
        for row in (0..height).step_by(step) {
            let line = &mut vertices[row * width..][..width];
            for column in (0..width).step_by(step) {
                line[column] = self.vertex(row * width + column);
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
        for &place in self.places() {
            let beside = self.vertex(place);
            if beside.is_inner() {
                vertices[place] = beside;
            }
        }
        vertices
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
