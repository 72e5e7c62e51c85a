//! The intensity residual beside geometry, against sliding along a wall (method 12.1).

use crate::association::found::{Found, NONE};
use crate::association::queries::Chosen;
use crate::association::target::Target;
use crate::gicp::Photometric;
use tessera_numerics::lanes::{add, dot, scale, sub};
use tessera_surface::{SurfaceView, Vertex};

/// Looks up, for each match, how its target's intensity differs and changes along the surface.
///
/// `information`: of a difference of 1 at standard deviation 1, in the units of the geometric
/// information; `sigma`: standard deviation of a difference, 0 to 1.
pub(crate) fn gather(
    found: &mut Found,
    chosen: &Chosen,
    target: &Target<'_>,
    information: f32,
    sigma: f32,
) -> Photometric {
    let width = target.surface.grid.width;
    let (mut sum, mut n) = (0.0f64, 0u32);
    for place in 0..found.len() {
        let (mut gradient, mut difference) = ([0.0; 3], 0.0);
        if found.vertex[place] != NONE && found.weight[place] > 0.0 {
            let vertex = found.vertex[place] as usize;
            if let Some(g) = gradient_at(&target.surface, vertex) {
                let seconds = target.shutter.row_time_s((vertex / width) as f32);
                gradient = target.shutter.turn(g, seconds);
                difference = target.surface.vertices[vertex].intensity - chosen.intensities[place];
                sum += f64::from(difference - dot(gradient, found.e.at(place)));
                n += 1;
            }
        }
        found.gradient.set(place, gradient);
        found.intensity[place] = difference;
    }
    if n == 0 {
        return Photometric::default();
    }
    let offset = (sum / f64::from(n)) as f32;
    // Without a gradient the intensity says nothing of the pose: its residual is taken out too.
    for place in 0..found.len() {
        if found.gradient.at(place) == [0.0; 3] {
            found.intensity[place] = offset;
        }
    }
    Photometric { information: information / (sigma * sigma), sigma, offset }
}

/// Change of intensity per metre along the surface at a vertex, from its four neighbours: the
/// tangent vector `g` with `g dp = dI` along both directions of the grid. `None` at depth edges and
/// where the neighbours do not span the surface.
fn gradient_at(surface: &SurfaceView<'_>, vertex: usize) -> Option<[f32; 3]> {
    let grid = surface.grid;
    let (row, column) = (vertex / grid.width, vertex % grid.width);
    if row == 0 || column == 0 || row + 1 >= grid.height || column + 1 >= grid.width {
        return None;
    }
    let v = &surface.vertices;
    let along = |before: &Vertex, after: &Vertex| {
        let d = sub(after.position, before.position);
        let off = dot(d, v[vertex].normal);
        let tangent = add(d, scale(-off, v[vertex].normal));
        (before.is_valid() && after.is_valid()).then_some((tangent, after.intensity - before.intensity))
    };
    let (right, by_column) = along(&v[vertex - 1], &v[vertex + 1])?;
    let (down, by_row) = along(&v[vertex - grid.width], &v[vertex + grid.width])?;
    let (rr, rd, dd) = (dot(right, right), dot(right, down), dot(down, down));
    let determinant = rr * dd - rd * rd;
    if !(determinant > 1e-3 * rr * dd && determinant > 0.0) {
        return None;
    }
    let alpha = (dd * by_column - rd * by_row) / determinant;
    let beta = (rr * by_row - rd * by_column) / determinant;
    let g = add(scale(alpha, right), scale(beta, down));
    g.iter().all(|c| c.is_finite()).then_some(g)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_surface::Grid;

    /// A slanted plane whose intensity rises by 0.5 a metre along x and falls by 0.25 along y.
    #[test]
    fn the_gradient_of_a_plane_is_found() {
        let grid = Grid { width: 5, height: 5, step: 4 };
        let mut vertices = Vec::new();
        for row in 0..5 {
            for column in 0..5 {
                let (x, y) = (column as f32 * 0.02, row as f32 * 0.03);
                vertices.push(Vertex {
                    position: [x, y, 1.0 + 0.5 * x],
                    normal: [0.5f32, 0.0, -1.0].map(|c| c / 1.25f32.sqrt()),
                    intensity: 0.5 + 0.5 * x - 0.25 * y,
                    flags_rgb: Vertex::pack(Vertex::VALID, 0, [0; 3]),
                });
            }
        }
        let g = gradient_at(&SurfaceView { grid, vertices: &vertices }, 12).unwrap();
        // Along the plane's x the length is sqrt(1.25) times x: the gradient has no normal part.
        assert!((g[0] - 0.4).abs() < 1e-3 && (g[1] + 0.25).abs() < 1e-3 && (g[2] - 0.2).abs() < 1e-3);
        vertices[11].flags_rgb = 0;
        assert_eq!(gradient_at(&SurfaceView { grid, vertices: &vertices }, 12), None);
    }
}
