//! The vertices between the kept ones, as a reader fills them in.

use crate::vertex::{Grid, Vertex};

/// Farthest two kept vertices may be from each other's tangent planes for others to stand between them, as part
/// of their depth and for each place from one to the other.
const MOST_BEND: f32 = 0.005;

/// Fills in the vertices between the kept ones: first those of the kept rows, then the rows between.
pub(super) fn interpolate(grid: Grid, step: usize, vertices: &mut [Vertex]) {
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

/// What [`interpolate`] fills in at one place.
pub(super) fn interpolated(grid: Grid, step: usize, vertices: &[Vertex], place: usize) -> Vertex {
    let (row, column) = (place / grid.width, place % grid.width);
    let (row_above, left) = (row - row % step, column - column % step);
    let of_row = |row: usize| {
        let at = |column: usize| vertices[row * grid.width + column];
        match column - left {
            0 => at(column),
            _ if left + step >= grid.width => Vertex::default(),
            place => between(&[at(left), at(left + step)], place, step),
        }
    };
    match row - row_above {
        0 => of_row(row),
        _ if row_above + step >= grid.height => Vertex::default(),
        place => between(&[of_row(row_above), of_row(row_above + step)], place, step),
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
