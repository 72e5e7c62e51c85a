//! Edges between neighbours of the grid, and quads of four of them (eq. 1-4; method 1.2-1.5).

use crate::planes::{PlaneLayout, PlaneRun, QuadMesh, Workspace};
use crate::settings::SurfaceSettings;
use tessera_geometry::DepthNoise;

/// Angle between an edge and the line of sight below which the edge is shadowed (eq. 1), degrees: the
/// paper's value.
const EDGE_ANGLE_DEG: f32 = 12.5;

/// The edge test of eq. 1, with its constants worked out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeTest {
    cos_sq: f32,
    tolerance_factor: f32,
    /// 1 joins the two tests by "or", 0 by "and".
    is_or: bool,
    noise: DepthNoise,
}

impl EdgeTest {
    pub(crate) fn new(settings: &SurfaceSettings) -> Self {
        let cosine = libm::cosf(EDGE_ANGLE_DEG.to_radians());
        let n = settings.step as f32;
        Self {
            cos_sq: cosine * cosine,
            // Eq. 4, read as linear in the step.
            tolerance_factor: 2.0 * n,
            // Far walls survive depth quantisation where either test suffices; the paper's wording is both.
            is_or: !settings.variant.is_paper(),
            noise: DepthNoise::default(),
        }
    }

    /// Eq. 1-4 for the edge between two points of one cloud, viewpoint at the origin.
    #[inline(always)]
    pub(crate) fn is_valid(&self, a: [f32; 3], b: [f32; 3]) -> bool {
        // The nearer endpoint occludes: the angle is taken there.
        let is_a_near = a[2] <= b[2];
        let near = [
            if is_a_near { a[0] } else { b[0] },
            if is_a_near { a[1] } else { b[1] },
            if is_a_near { a[2] } else { b[2] },
        ];
        let edge = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
        let length_sq = edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2];
        let range_sq = near[0] * near[0] + near[1] * near[1] + near[2] * near[2];
        let dot = near[0] * edge[0] + near[1] * edge[1] + near[2] * edge[2];
        let tolerance_m = self.tolerance_factor * self.noise.sigma_m(near[2]);
        let is_short = length_sq <= tolerance_m * tolerance_m;
        // |cos| <= cos(eps): not along one line of sight. Coincident points fail by `<`.
        let is_across = dot * dot < self.cos_sq * range_sq * length_sq;
        let joined = (is_short & is_across) | (self.is_or & (is_short | is_across));
        joined & (near[2] > 0.0)
    }
}

/// Fills edges, quads and the number of quads around each vertex.
#[inline(always)]
pub(crate) fn build(test: EdgeTest, w: &mut Workspace) {
    let PlaneLayout { grid, stride } = w.layout;
    let n = grid.width;
    for row in 0..grid.height {
        let start = w.layout.row(row);
        let here = w.points.run(start, n);
        let out = start..start + n;
        edge_row(test, here, w.points.run(start + 1, n), &mut w.mesh.right[out.clone()]);
        edge_row(test, here, w.points.run(start + stride, n), &mut w.mesh.down[out.clone()]);
        edge_row(test, here, w.points.run(start + stride + 1, n), &mut w.mesh.diagonal[out]);
    }
    let QuadMesh { right, down, quad, n_quads, .. } = &mut w.mesh;
    for row in 0..grid.height {
        let start = w.layout.row(row);
        quad_row(
            [&right[start..start + n], &right[start + stride..start + stride + n]],
            [&down[start..start + n], &down[start + 1..start + 1 + n]],
            &mut quad[start..start + n],
        );
    }
    for row in 0..grid.height {
        let start = w.layout.row(row);
        let above = start - stride;
        count_row(
            [&quad[start..start + n], &quad[start - 1..start - 1 + n]],
            [&quad[above..above + n], &quad[above - 1..above - 1 + n]],
            &mut n_quads[start..start + n],
        );
    }
}

// The rows are functions of their own so that the compiler knows the output overlaps no input:
// without that it makes no vectors of loops over so many planes.

#[inline(always)]
fn edge_row(test: EdgeTest, a: PlaneRun<'_>, b: PlaneRun<'_>, out: &mut [f32]) {
    let n = out.len();
    let (ax, ay, az) = (&a.x[..n], &a.y[..n], &a.z[..n]);
    let (bx, by, bz) = (&b.x[..n], &b.y[..n], &b.z[..n]);
    for c in 0..n {
        let is_valid = test.is_valid([ax[c], ay[c], az[c]], [bx[c], by[c], bz[c]]);
        out[c] = if is_valid { 1.0 } else { 0.0 };
    }
}

#[inline(always)]
fn quad_row([top, bottom]: [&[f32]; 2], [left, right]: [&[f32]; 2], out: &mut [f32]) {
    let n = out.len();
    let (top, bottom, left, right) = (&top[..n], &bottom[..n], &left[..n], &right[..n]);
    for c in 0..n {
        out[c] = top[c] * bottom[c] * left[c] * right[c];
    }
}

#[inline(always)]
fn count_row([here, left]: [&[f32]; 2], [above, corner]: [&[f32]; 2], out: &mut [f32]) {
    let n = out.len();
    let (here, left, above, corner) = (&here[..n], &left[..n], &above[..n], &corner[..n]);
    for c in 0..n {
        out[c] = here[c] + left[c] + above[c] + corner[c];
    }
}
