//! Normals from the quads around a vertex (SPEC 3, eq. 8).

use crate::mesh::QUAD;
use crate::planes::{Planes3, Workspace};

/// Which points the normals are taken from.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum From {
    Raw,
    Filtered,
}

/// Fills `normals` (from raw points) or `filtered_normals` (from filtered points).
///
/// The sum of unnormalised cross products weighs faces by area; a quad counts by the cross
/// product of its diagonals, which is the sum of its two triangles'.
pub(crate) fn fill(w: &mut Workspace, from: From, min_view_cosine: f32) {
    let width = w.grid.width;
    let (points, normals) = match from {
        From::Raw => (&w.points, &mut w.normals),
        From::Filtered => (&w.filtered_points, &mut w.filtered_normals),
    };
    quad_normals(points, &w.bits, width, w.grid.height, &mut w.quad_normals);
    let q = &w.quad_normals;
    for row in 0..w.grid.height {
        for column in 0..width {
            let i = row * width + column;
            // Fewer than one quad: no face to take a normal from.
            if w.quads[i] == 0 {
                normals.set(i, [0.0; 3]);
                continue;
            }
            let mut sum = q.at(i);
            let mut add = |j: usize| {
                sum[0] += q.x[j];
                sum[1] += q.y[j];
                sum[2] += q.z[j];
            };
            if column > 0 {
                add(i - 1);
            }
            if row > 0 {
                add(i - width);
                if column > 0 {
                    add(i - width - 1);
                }
            }
            normals.set(i, towards_camera(sum, points.at(i), min_view_cosine));
        }
    }
}

/// Unit length and facing the camera at the origin; zero at grazing incidence, where noise
/// flips normals (TRAPS 16).
#[inline]
pub(crate) fn towards_camera(n: [f32; 3], p: [f32; 3], min_view_cosine: f32) -> [f32; 3] {
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    let range = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
    let toward = -(n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
    if !(toward.abs() > min_view_cosine * length * range) || !(length > 1e-12) {
        return [0.0; 3];
    }
    let scale = if toward > 0.0 { 1.0 / length } else { -1.0 / length };
    [n[0] * scale, n[1] * scale, n[2] * scale]
}

fn quad_normals(points: &Planes3, bits: &[u8], width: usize, height: usize, out: &mut Planes3) {
    for row in 0..height {
        for column in 0..width {
            let i = row * width + column;
            if bits[i] & QUAD == 0 {
                out.set(i, [0.0; 3]);
                continue;
            }
            let (a, b) = (points.at(i), points.at(i + width + 1));
            let (c, d) = (points.at(i + width), points.at(i + 1));
            let (u, v) = ([b[0] - a[0], b[1] - a[1], b[2] - a[2]], [d[0] - c[0], d[1] - c[1], d[2] - c[2]]);
            out.set(i, [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]);
        }
    }
}
