//! The multilateral filter of points and normals over mesh rings (eq. 6-7; method 2).

use crate::normals::towards_camera;
use crate::planes::{PlaneLayout, PlaneRun, RowSums, Workspace};
use crate::rings::RingWalk;
use crate::settings::SurfaceSettings;
use tessera_numerics::MethodVariant;

/// One Jacobi pass: reads points and normals, writes the filtered ones.
#[inline(always)]
pub(crate) fn pass(settings: &SurfaceSettings, w: &mut Workspace, walk: Option<&mut RingWalk>) {
    match walk {
        None => one_ring(settings, w),
        Some(walk) => rings(settings, w, walk),
    }
}

/// Weight of the distance, per metre (eq. 7, alpha): the paper's value.
const ALPHA: f32 = 1.0;
/// Weight of the difference of intensities (eq. 7, gamma): the paper's value.
const GAMMA: f32 = 1.0;
/// Weight of a vertex in its own mean: that of a neighbour that equals it (eq. 6 leaves it open).
const OWN: f32 = 1.0;

/// The three factors of eq. 7 in one exponential, `beta` that of the normals; zero unless both have a
/// normal.
#[inline(always)]
fn weight(beta: f32, p: [[f32; 3]; 2], n: [[f32; 3]; 2], intensity: [f32; 2]) -> f32 {
    let d = [p[0][0] - p[1][0], p[0][1] - p[1][1], p[0][2] - p[1][2]];
    let distance_m = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    let turn = (n[0][0] - n[1][0]).abs() + (n[0][1] - n[1][1]).abs() + (n[0][2] - n[1][2]).abs();
    let contrast = (intensity[0] - intensity[1]).abs();
    let exponent = ALPHA * distance_m + beta * turn + GAMMA * contrast;
    let has_normals = is_normal(n[0]) & is_normal(n[1]);
    if has_normals { exp_negative(exponent) } else { 0.0 }
}

#[inline(always)]
fn is_normal(n: [f32; 3]) -> bool {
    n[0].abs() + n[1].abs() + n[2].abs() > 0.5
}

/// `exp(-x)` for `x >= 0`, absolute error below 1e-5, in plain arithmetic: the same bits on every
/// machine and no call in the inner loop. `exp(-x) = (exp(-x/16))^16` with a polynomial.
#[inline(always)]
fn exp_negative(x: f32) -> f32 {
    // Beyond 32 the polynomial leaves its range; exp(-32) is 1e-14, as good as nothing.
    let y = -(if x < 32.0 { x } else { 32.0 }) * (1.0 / 16.0);
    let e = 1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0)))));
    let e2 = e * e;
    let e4 = e2 * e2;
    let e8 = e4 * e4;
    e8 * e8
}

/// The 1-ring: each edge's weight is computed once and used from both ends. Row by row, so that
/// what a row needs is still in the cache.
#[inline(always)]
fn one_ring(settings: &SurfaceSettings, w: &mut Workspace) {
    let PlaneLayout { grid, stride } = w.layout;
    let n = grid.width;
    for row in 0..grid.height {
        let start = w.layout.row(row);
        let edges = [(1, &w.mesh.right), (stride, &w.mesh.down), (stride + 1, &w.mesh.diagonal)];
        for (plane, (offset, edge)) in w.weights.iter_mut().zip(edges) {
            let there = start + offset;
            weight_row(
                settings,
                [w.points.run(start, n), w.points.run(there, n)],
                [w.normals.run(start, n), w.normals.run(there, n)],
                [&w.intensity[start..start + n], &w.intensity[there..there + n]],
                &edge[start..start + n],
                &mut plane[start..start + n],
            );
        }
        let [right, down, diagonal] = &w.weights;
        // Neighbour, and where the weight of the edge to it is kept.
        let neighbours = [
            (start + 1, right, start),
            (start + stride, down, start),
            (start + stride + 1, diagonal, start),
            (start - 1, right, start - 1),
            (start - stride, down, start - stride),
            (start - stride - 1, diagonal, start - stride - 1),
        ];
        let weights = neighbours.map(|(_, weights, at)| &weights[at..at + n]);
        let (points, normals) = (w.points.run(start, n), w.normals.run(start, n));
        w.sums.fill(
            weights,
            (points, neighbours.map(|(there, ..)| w.points.run(there, n))),
            (normals, neighbours.map(|(there, ..)| w.normals.run(there, n))),
        );
        finish_row(
            settings,
            &w.sums,
            (points, normals),
            &w.mesh.n_quads[start..start + n],
            w.filtered_points.run_mut(start, n),
            w.filtered_normals.run_mut(start, n),
        );
    }
}

#[inline(always)]
fn weight_row(
    s: &SurfaceSettings,
    points: [PlaneRun<'_>; 2],
    normals: [PlaneRun<'_>; 2],
    intensity: [&[f32]; 2],
    edge: &[f32],
    out: &mut [f32],
) {
    let n = out.len();
    let ([p, q], [u, v]) = (points.map(|r| r.first(n)), normals.map(|r| r.first(n)));
    let (i, j, edge) = (&intensity[0][..n], &intensity[1][..n], &edge[..n]);
    for c in 0..n {
        out[c] = edge[c] * weight(s.filter_normal, [p.at(c), q.at(c)], [u.at(c), v.at(c)], [i[c], j[c]]);
    }
}

/// A vertex's own run of values, and those of its neighbours.
type Around<'a> = (PlaneRun<'a>, [PlaneRun<'a>; 6]);

impl RowSums {
    #[inline(always)]
    fn fill(&mut self, weights: [&[f32]; 6], p: Around<'_>, u: Around<'_>) {
        weight_sums(weights, &mut self.weight);
        for (sum, (at, around)) in [(&mut self.point, p), (&mut self.normal, u)] {
            weighted_sums(weights, at.x, around.map(|r| r.x), &mut sum.x);
            weighted_sums(weights, at.y, around.map(|r| r.y), &mut sum.y);
            weighted_sums(weights, at.z, around.map(|r| r.z), &mut sum.z);
        }
    }
}

#[inline(always)]
fn weight_sums(weights: [&[f32]; 6], out: &mut [f32]) {
    let n = out.len();
    let weights = weights.map(|w| &w[..n]);
    for c in 0..n {
        out[c] = weights.iter().fold(OWN, |sum, w| sum + w[c]);
    }
}

#[inline(always)]
fn weighted_sums(weights: [&[f32]; 6], at: &[f32], around: [&[f32]; 6], out: &mut [f32]) {
    let n = out.len();
    let (weights, at, around) = (weights.map(|w| &w[..n]), &at[..n], around.map(|v| &v[..n]));
    for c in 0..n {
        let mut sum = OWN * at[c];
        for k in 0..6 {
            sum += weights[k][c] * around[k][c];
        }
        out[c] = sum;
    }
}

#[inline(always)]
fn finish_row(
    s: &SurfaceSettings,
    sums: &RowSums,
    raw: (PlaneRun<'_>, PlaneRun<'_>),
    n_quads: &[f32],
    [px, py, pz]: [&mut [f32]; 3],
    [ux, uy, uz]: [&mut [f32]; 3],
) {
    let n = px.len();
    let (p, u) = (raw.0.first(n), raw.1.first(n));
    let (sum_p, sum_u) = (sums.point.run(0, n), sums.normal.run(0, n));
    let (weights, n_quads) = (&sums.weight[..n], &n_quads[..n]);
    point_row(s.variant, weights, sum_p, (p, u), n_quads, px, py, pz);
    turn_row(weights, sum_u, (p, u), ux, uy, uz);
}

#[inline(always)]
#[expect(
    clippy::too_many_arguments,
    reason = "each output is an argument, so that it is known to overlap nothing"
)]
fn point_row(
    variant: MethodVariant,
    weights: &[f32],
    sum: PlaneRun<'_>,
    (p, u): (PlaneRun<'_>, PlaneRun<'_>),
    n_quads: &[f32],
    x: &mut [f32],
    y: &mut [f32],
    z: &mut [f32],
) {
    let n = x.len();
    let (sum, p, u) = (sum.first(n), p.first(n), u.first(n));
    let (weights, n_quads, y, z) = (&weights[..n], &n_quads[..n], &mut y[..n], &mut z[..n]);
    for c in 0..n {
        [x[c], y[c], z[c]] = moved(variant, weights[c], sum.at(c), p.at(c), u.at(c), n_quads[c] < 4.0);
    }
}

#[inline(always)]
fn turn_row(
    weights: &[f32],
    sum: PlaneRun<'_>,
    (p, u): (PlaneRun<'_>, PlaneRun<'_>),
    x: &mut [f32],
    y: &mut [f32],
    z: &mut [f32],
) {
    let n = x.len();
    let (sum, p, u) = (sum.first(n), p.first(n), u.first(n));
    let (weights, y, z) = (&weights[..n], &mut y[..n], &mut z[..n]);
    for c in 0..n {
        [x[c], y[c], z[c]] = turned(weights[c], sum.at(c), p.at(c), u.at(c));
    }
}

/// Rings 1 to k united, in one pass.
fn rings(settings: &SurfaceSettings, w: &mut Workspace, walk: &mut RingWalk) {
    let beta = settings.filter_normal;
    for row in 0..w.layout.grid.height {
        for i in w.layout.row(row)..w.layout.row(row) + w.layout.grid.width {
            let (p, u) = (w.points.at(i), w.normals.at(i));
            let (mut sum, mut point, mut normal) = (OWN, p, u);
            if p[2] > 0.0 {
                for &j in walk.neighbours(&w.mesh, w.layout.stride, i, settings.filter_rings) {
                    let (q, v) = (w.points.at(j), w.normals.at(j));
                    let weight = weight(beta, [p, q], [u, v], [w.intensity[i], w.intensity[j]]);
                    sum += weight;
                    for k in 0..3 {
                        point[k] += weight * q[k];
                        normal[k] += weight * v[k];
                    }
                }
            }
            let is_boundary = w.mesh.n_quads[i] < 4.0;
            w.filtered_points.set(i, moved(settings.variant, sum, point, p, u, is_boundary));
            w.filtered_normals.set(i, turned(sum, normal, p, u));
        }
    }
}

/// The point after the filter. Without a normal or a neighbour it stays (method T18).
#[inline(always)]
fn moved(
    variant: MethodVariant,
    weight: f32,
    sum: [f32; 3],
    p: [f32; 3],
    n: [f32; 3],
    is_boundary: bool,
) -> [f32; 3] {
    let is_filtered = is_normal(n) & (weight > 0.0);
    let scale = 1.0 / weight;
    let mean = [sum[0] * scale, sum[1] * scale, sum[2] * scale];
    let is_held = is_boundary & !variant.is_paper();
    select(is_filtered & !is_held, mean, p)
}

/// The normal after the filter, unit length again. Without one it stays none.
#[inline(always)]
fn turned(weight: f32, sum: [f32; 3], p: [f32; 3], n: [f32; 3]) -> [f32; 3] {
    let turned = towards_camera(sum, p, 0.0);
    let has_turned = is_normal(n) & (weight > 0.0) & is_normal(turned);
    select(has_turned, turned, n)
}

/// By coordinate and without a branch. (`map` over an array would go through memory.)
#[inline(always)]
fn select(condition: bool, a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        if condition { a[0] } else { b[0] },
        if condition { a[1] } else { b[1] },
        if condition { a[2] } else { b[2] },
    ]
}

#[cfg(test)]
mod tests {
    use super::exp_negative;

    #[test]
    fn the_exponential_is_close_over_its_whole_range() {
        let mut x = 0.0f32;
        while x < 60.0 {
            let exact = libm::exp(-f64::from(x));
            let error = (f64::from(exp_negative(x)) - exact).abs();
            assert!(error < 1e-5, "exp(-{x}) off by {error}");
            x += 0.01;
        }
    }
}
