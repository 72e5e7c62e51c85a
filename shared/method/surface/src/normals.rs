//! Normals from the quads around a vertex (eq. 8; method 3).

use crate::planes::{PlaneLayout, PlaneRun, Workspace};

/// Least cosine between a normal and the line of sight, 81 degrees: beyond it noise flips normals
/// (method T16), so the vertex is dropped.
const MIN_VIEW_COSINE: f32 = 0.15;

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
#[inline(always)]
pub(crate) fn fill(w: &mut Workspace, from: From) {
    quad_normals(w, from);
    let PlaneLayout { grid, stride } = w.layout;
    let n = grid.width;
    let (points, normals) = match from {
        From::Raw => (&w.points, &mut w.normals),
        From::Filtered => (&w.filtered_points, &mut w.filtered_normals),
    };
    let q = &w.quad_normals;
    for row in 0..grid.height {
        let start = w.layout.row(row);
        let quads = [start, start - 1, start - stride, start - stride - 1].map(|at| q.run(at, n));
        let [x, y, z] = normals.run_mut(start, n);
        normal_row(quads, points.run(start, n), x, y, z);
    }
}

#[inline(always)]
fn normal_row(quads: [PlaneRun<'_>; 4], p: PlaneRun<'_>, x: &mut [f32], y: &mut [f32], z: &mut [f32]) {
    let n = x.len();
    let ([here, left, above, corner], p) = (quads.map(|q| q.first(n)), p.first(n));
    let (y, z) = (&mut y[..n], &mut z[..n]);
    for c in 0..n {
        let sum = [
            here.x[c] + left.x[c] + above.x[c] + corner.x[c],
            here.y[c] + left.y[c] + above.y[c] + corner.y[c],
            here.z[c] + left.z[c] + above.z[c] + corner.z[c],
        ];
        [x[c], y[c], z[c]] = towards_camera(sum, p.at(c), MIN_VIEW_COSINE);
    }
}

/// Unit length and facing the camera at the origin; zero at grazing incidence, where noise
/// flips normals (method T16), and where there is no face.
#[inline(always)]
pub(crate) fn towards_camera(n: [f32; 3], p: [f32; 3], min_view_cosine: f32) -> [f32; 3] {
    let length = (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt();
    let range = (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt();
    let toward = -(n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
    let is_normal = (toward.abs() > min_view_cosine * length * range) & (length > 1e-12);
    let inverse = 1.0 / length;
    let signed = if toward > 0.0 { inverse } else { -inverse };
    let scale = if is_normal { signed } else { 0.0 };
    [n[0] * scale, n[1] * scale, n[2] * scale]
}

#[inline(always)]
fn quad_normals(w: &mut Workspace, from: From) {
    let PlaneLayout { grid, stride } = w.layout;
    let n = grid.width;
    let points = if from == From::Raw { &w.points } else { &w.filtered_points };
    for row in 0..grid.height {
        let start = w.layout.row(row);
        let corners = [start, start + stride + 1, start + stride, start + 1].map(|at| points.run(at, n));
        let [x, y, z] = w.quad_normals.run_mut(start, n);
        quad_row(corners, &w.mesh.quad[start..start + n], x, y, z);
    }
}

#[inline(always)]
fn quad_row(corners: [PlaneRun<'_>; 4], quad: &[f32], x: &mut [f32], y: &mut [f32], z: &mut [f32]) {
    let n = x.len();
    let [a, b, c, d] = corners.map(|q| q.first(n));
    let (quad, y, z) = (&quad[..n], &mut y[..n], &mut z[..n]);
    for i in 0..n {
        let u = [b.x[i] - a.x[i], b.y[i] - a.y[i], b.z[i] - a.z[i]];
        let v = [d.x[i] - c.x[i], d.y[i] - c.y[i], d.z[i] - c.z[i]];
        x[i] = quad[i] * (u[1] * v[2] - u[2] * v[1]);
        y[i] = quad[i] * (u[2] * v[0] - u[0] * v[2]);
        z[i] = quad[i] * (u[0] * v[1] - u[1] * v[0]);
    }
}
