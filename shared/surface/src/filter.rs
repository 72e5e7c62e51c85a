//! The multilateral filter of points and normals over mesh rings (SPEC 2, eq. 6-7).

use crate::mesh::{DIAGONAL, DOWN, RIGHT};
use crate::normals::towards_camera;
use crate::planes::Workspace;
use crate::rings::RingWalk;
use crate::settings::{BoundaryRule, SurfaceSettings};

/// One Jacobi pass: reads points and normals, writes the filtered ones.
pub(crate) fn pass(settings: &SurfaceSettings, w: &mut Workspace, walk: Option<&mut RingWalk>) {
    match walk {
        None => one_ring(settings, w),
        Some(walk) => rings(settings, w, walk),
    }
}

/// Eq. 7 for two vertices; zero unless both have a normal.
#[inline]
fn weight(s: &SurfaceSettings, w: &Workspace, i: usize, j: usize) -> f32 {
    let (p, q) = (w.points.at(i), w.points.at(j));
    let (n, m) = (w.normals.at(i), w.normals.at(j));
    let d = [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
    let distance_m = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
    let turn = (n[0] - m[0]).abs() + (n[1] - m[1]).abs() + (n[2] - m[2]).abs();
    let contrast = (w.intensity[i] - w.intensity[j]).abs();
    let exponent = s.filter_position * distance_m + s.filter_normal * turn + s.filter_intensity * contrast;
    let has_normals = (n[2] != 0.0) & (m[2] != 0.0);
    if has_normals { exp_negative(exponent) } else { 0.0 }
}

/// `exp(-x)` for `x >= 0` to 2e-7, in plain arithmetic: the same bits on every machine, and no
/// call in the inner loop. `exp(-x) = (exp(-x/16))^16` with a polynomial of degree five.
#[inline]
fn exp_negative(x: f32) -> f32 {
    let y = -x.min(80.0) * (1.0 / 16.0);
    let mut e = 1.0 + y * (1.0 + y * (0.5 + y * (1.0 / 6.0 + y * (1.0 / 24.0 + y * (1.0 / 120.0)))));
    // Beyond x = 32 the polynomial leaves its range; such weights are below 1e-14.
    if y < -2.0 {
        e = 0.0;
    }
    let e2 = e * e;
    let e4 = e2 * e2;
    let e8 = e4 * e4;
    e8 * e8
}

/// The 1-ring: each edge's weight is computed once and used from both ends.
fn one_ring(settings: &SurfaceSettings, w: &mut Workspace) {
    let width = w.grid.width;
    let n = w.grid.len();
    let mut weights = std::mem::take(&mut w.edge_weights);
    for (plane, (bit, offset)) in weights.iter_mut().zip([(RIGHT, 1), (DOWN, width), (DIAGONAL, width + 1)]) {
        for i in 0..n {
            plane[i] = if w.bits[i] & bit != 0 { weight(settings, w, i, i + offset) } else { 0.0 };
        }
    }
    let [right, down, diagonal] = &weights;
    for i in 0..n {
        let mut sum = Sum::start(settings, w, i);
        let mut add = |wt: f32, j: usize| {
            if wt > 0.0 {
                sum.add(w, wt, j);
            }
        };
        add(right[i], i + 1);
        add(down[i], i + width);
        add(diagonal[i], i + width + 1);
        if i >= 1 {
            add(right[i - 1], i - 1);
        }
        if i >= width {
            add(down[i - width], i - width);
        }
        if i > width {
            add(diagonal[i - width - 1], i - width - 1);
        }
        sum.finish(settings, w, i);
    }
    w.edge_weights = weights;
}

/// Rings 1 to k united, in one pass.
fn rings(settings: &SurfaceSettings, w: &mut Workspace, walk: &mut RingWalk) {
    let bits = std::mem::take(&mut w.bits);
    for i in 0..w.grid.len() {
        let mut sum = Sum::start(settings, w, i);
        if w.points.z[i] > 0.0 {
            for &j in walk.neighbours(&bits, w.grid, i, settings.filter_rings) {
                let wt = weight(settings, w, i, j);
                if wt > 0.0 {
                    sum.add(w, wt, j);
                }
            }
        }
        sum.finish(settings, w, i);
    }
    w.bits = bits;
}

/// The weighted sums of eq. 6 for one vertex.
struct Sum {
    weight: f32,
    point: [f32; 3],
    normal: [f32; 3],
}

impl Sum {
    #[inline]
    fn start(settings: &SurfaceSettings, w: &Workspace, i: usize) -> Self {
        if settings.filter_include_self {
            Self { weight: 1.0, point: w.points.at(i), normal: w.normals.at(i) }
        } else {
            Self { weight: 0.0, point: [0.0; 3], normal: [0.0; 3] }
        }
    }

    #[inline]
    fn add(&mut self, w: &Workspace, weight: f32, j: usize) {
        self.weight += weight;
        let (p, n) = (w.points.at(j), w.normals.at(j));
        for k in 0..3 {
            self.point[k] += weight * p[k];
            self.normal[k] += weight * n[k];
        }
    }

    #[inline]
    fn finish(self, settings: &SurfaceSettings, w: &mut Workspace, i: usize) {
        let (p, n) = (w.points.at(i), w.normals.at(i));
        // Nothing to average, or no normal: keep both (an invalid normal must not spread, TRAPS 18).
        if n[2] == 0.0 && n[0] == 0.0 && n[1] == 0.0 || !(self.weight > 0.0) {
            w.filtered_points.set(i, p);
            w.filtered_normals.set(i, n);
            return;
        }
        let normal = towards_camera(self.normal, p, 0.0);
        w.filtered_normals.set(i, if normal == [0.0; 3] { n } else { normal });
        let scale = 1.0 / self.weight;
        let mean = [self.point[0] * scale, self.point[1] * scale, self.point[2] * scale];
        let is_boundary = w.quads[i] < 4;
        let moved = match settings.filter_boundary {
            BoundaryRule::Full => mean,
            _ if !is_boundary => mean,
            BoundaryRule::Keep => p,
            BoundaryRule::AlongNormal => {
                let d = n[0] * (mean[0] - p[0]) + n[1] * (mean[1] - p[1]) + n[2] * (mean[2] - p[2]);
                [p[0] + d * n[0], p[1] + d * n[1], p[2] + d * n[2]]
            }
        };
        w.filtered_points.set(i, moved);
    }
}

#[cfg(test)]
mod tests {
    use super::exp_negative;

    #[test]
    fn the_exponential_is_close_over_its_whole_range() {
        let mut x = 0.0f32;
        while x < 40.0 {
            let exact = libm::exp(-f64::from(x));
            let error = (f64::from(exp_negative(x)) - exact).abs();
            // Weights matter absolutely: a relative error in 1e-9 is nothing.
            assert!(error < 2e-5, "exp(-{x}) off by {error}");
            x += 0.01;
        }
    }
}
