//! Which neighbours of the grid are joined by an edge, and which four make a quad (SPEC 1.2-1.5).

use crate::planes::{Planes3, Workspace};
use crate::settings::{EdgeRule, LengthRule, SurfaceSettings};
use tessera_geometry::DepthNoise;

/// The edge to the right neighbour is valid.
pub(crate) const RIGHT: u8 = 1;
/// The edge to the lower neighbour is valid.
pub(crate) const DOWN: u8 = 2;
/// The edge to the lower right neighbour is valid.
pub(crate) const DIAGONAL: u8 = 4;
/// The cell whose upper left corner this vertex is, is a quad.
pub(crate) const QUAD: u8 = 8;

/// The edge test of eq. 1, with its constants worked out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeTest {
    cos_sq: f32,
    tolerance_factor: f32,
    rule: EdgeRule,
    noise: DepthNoise,
}

impl EdgeTest {
    pub(crate) fn new(settings: &SurfaceSettings) -> Self {
        let cosine = libm::cosf(settings.edge_angle_deg.to_radians());
        let n = settings.step as f32;
        let growth = match settings.length_rule {
            LengthRule::Linear => n,
            LengthRule::Quadratic => n * n,
        };
        Self {
            cos_sq: cosine * cosine,
            tolerance_factor: 2.0 * growth,
            rule: settings.edge_rule,
            noise: DepthNoise { model: settings.noise },
        }
    }

    /// Eq. 1-4 for the edge between two points of one cloud, viewpoint at the origin.
    #[inline]
    pub(crate) fn is_valid(&self, a: [f32; 3], b: [f32; 3]) -> bool {
        // The nearer endpoint occludes: the angle is taken there.
        let (near, far) = if a[2] <= b[2] { (a, b) } else { (b, a) };
        let edge = [near[0] - far[0], near[1] - far[1], near[2] - far[2]];
        let length_sq = edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2];
        let range_sq = near[0] * near[0] + near[1] * near[1] + near[2] * near[2];
        let dot = near[0] * edge[0] + near[1] * edge[1] + near[2] * edge[2];
        let tolerance_m = self.tolerance_factor * self.noise.sigma_m(near[2]);
        let is_short = length_sq <= tolerance_m * tolerance_m;
        // |cos| <= cos(eps): not along one line of sight. Coincident points fail by `<`.
        let is_across = dot * dot < self.cos_sq * range_sq * length_sq;
        let joined = match self.rule {
            EdgeRule::Or => is_short | is_across,
            EdgeRule::And => is_short & is_across,
        };
        joined & (near[2] > 0.0)
    }
}

/// Fills edge and quad bits and counts the quads around each vertex.
pub(crate) fn build(test: &EdgeTest, w: &mut Workspace) {
    let (width, height) = (w.grid.width, w.grid.height);
    edges(test, &w.points, width, height, &mut w.bits);
    for row in 0..height.saturating_sub(1) {
        let (upper, lower) = w.bits[row * width..].split_at_mut(width);
        for c in 0..width - 1 {
            let four_sides =
                (upper[c] & RIGHT) & (upper[c] & DOWN) >> 1 & (lower[c] & RIGHT) & (upper[c + 1] & DOWN) >> 1;
            upper[c] |= four_sides * QUAD;
        }
    }
    count_quads(w);
}

fn edges(test: &EdgeTest, points: &Planes3, width: usize, height: usize, bits: &mut [u8]) {
    for row in 0..height {
        for column in 0..width {
            let i = row * width + column;
            let p = points.at(i);
            let mut b = 0;
            if p[2] > 0.0 {
                let (has_right, has_down) = (column + 1 < width, row + 1 < height);
                if has_right && test.is_valid(p, points.at(i + 1)) {
                    b |= RIGHT;
                }
                if has_down && test.is_valid(p, points.at(i + width)) {
                    b |= DOWN;
                }
                if has_right && has_down && test.is_valid(p, points.at(i + width + 1)) {
                    b |= DIAGONAL;
                }
            }
            bits[i] = b;
        }
    }
}

fn count_quads(w: &mut Workspace) {
    let width = w.grid.width;
    w.quads.fill(0);
    for row in 0..w.grid.height.saturating_sub(1) {
        let bits = &w.bits[row * width..(row + 1) * width];
        let (upper, lower) = w.quads[row * width..].split_at_mut(width);
        for c in 0..width - 1 {
            let quad = (bits[c] & QUAD) / QUAD;
            upper[c] += quad;
            upper[c + 1] += quad;
            lower[c] += quad;
            lower[c + 1] += quad;
        }
    }
}
