//! What a search found, query by query, and which of it is believed (SPEC 10).

use crate::columns::Columns3;
use crate::lanes::{LANES, Lanes, Real, dot, rotate, sub};
use crate::target::ShutterTable;
use std::array::from_fn;
use tessera_geometry::DepthNoise;
use tessera_surface::Vertex;

/// No vertex was found.
pub(crate) const NONE: u32 = u32::MAX;

/// One place for each query of a pair, filled up to whole lanes with places that found nothing.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// Target vertex, or [`NONE`].
    pub(crate) vertex: Vec<u32>,
    /// Grid row of that vertex.
    row: Vec<f32>,
    /// 1 where the vertex is valid and not at a depth edge, else 0.
    is_inner: Vec<f32>,
    /// Target point and normal; 0 where nothing was found.
    b: Columns3,
    pub(crate) nb: Columns3,
    /// Query normal in the target's frame.
    pub(crate) na: Columns3,
    /// Residual `b - T a` in the target's frame.
    pub(crate) e: Columns3,
    pub(crate) distance_sq: Vec<f32>,
    /// Normal residual in standard deviations of surfaces and pose, without its sign.
    pub(crate) sigmas: Vec<f32>,
    /// Inverse variance of the normal residual; 0 where the place is not a match.
    pub(crate) weight: Vec<f32>,
    /// Brightness of the target less that of the query.
    pub(crate) brightness: Vec<f32>,
    /// Change of the target's brightness along its surface, per metre.
    pub(crate) gradient: Columns3,
}

impl Found {
    /// Room for `n` places, a whole number of lanes, all of which found nothing.
    pub(crate) fn reset(&mut self, n: usize) {
        for column in [&mut self.row, &mut self.is_inner, &mut self.distance_sq] {
            column.clear();
            column.resize(n, 0.0);
        }
        for column in [&mut self.sigmas, &mut self.weight, &mut self.brightness] {
            column.resize(n, 0.0);
        }
        for columns in [&mut self.b, &mut self.nb] {
            columns.reset(n);
        }
        for columns in [&mut self.na, &mut self.e, &mut self.gradient] {
            columns.resize(n);
        }
        self.vertex.clear();
        self.vertex.resize(n, NONE);
    }

    pub(crate) fn len(&self) -> usize {
        self.vertex.len()
    }

    #[inline(always)]
    pub(crate) fn put(&mut self, place: usize, vertex: usize, width: usize, v: &Vertex) {
        self.vertex[place] = vertex as u32;
        self.row[place] = (vertex / width) as f32;
        self.is_inner[place] = if v.is_inner() { 1.0 } else { 0.0 };
        self.b.set(place, v.position);
        self.nb.set(place, v.normal);
    }
}

/// The limits that a match must keep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Largest distance: `distance_m + distance_sigmas * sigma(z_b)`.
    pub(crate) distance_m: f32,
    pub(crate) distance_sigmas: f32,
    pub(crate) cosine: f32,
    /// What the error of the pose adds to the variance of a residual, square metres.
    pub(crate) pose_variance: f32,
}

/// Turns what was found into residuals and weights, eight places at a time.
pub(crate) struct Judge<'a> {
    pub(crate) found: &'a mut Found,
    /// Query points in the target's frame at its stamp.
    pub(crate) q: &'a Columns3,
    /// Query points and normals in their own frame.
    pub(crate) points: &'a Columns3,
    pub(crate) normals: &'a Columns3,
    /// `target_from_query`.
    pub(crate) motion: &'a [f32; 12],
    pub(crate) shutter: ShutterTable,
    pub(crate) noise: DepthNoise,
    pub(crate) limits: Limits,
}

impl pulp::WithSimd for Judge<'_> {
    /// Queries that lie more than three standard deviations in front of the target's surface.
    type Output = u32;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> u32 {
        if self.shutter.is_global() { judge::<false>(self) } else { judge::<true>(self) }
    }
}

#[inline(always)]
fn judge<const IS_ROLLING: bool>(it: Judge<'_>) -> u32 {
    let Judge { found, q, points, normals, motion, shutter, noise, limits } = it;
    let sigma = |z: Lanes| z.map(|z| noise.sigma_m(z));
    let mut in_front = [0u32; LANES];
    for at in (0..found.len()).step_by(LANES) {
        let (mut b, mut nb) = (found.b.load(at), found.nb.load(at));
        let (sigma_a, sigma_b) = (sigma(Lanes::load(&points.z, at)), sigma(b[2]));
        if IS_ROLLING {
            let seconds = shutter.inner_row_time_s(Lanes::load(&found.row, at));
            (b, nb) = (shutter.move_point(b, seconds), shutter.turn(nb, seconds));
        }
        let e = sub(b, q.load(at));
        let na = rotate(motion, normals.load(at));
        let variance = sigma_a * sigma_a + sigma_b * sigma_b;
        let (residual, distance_sq, cosine) = (dot(e, nb), dot(e, e), dot(na, nb));
        let residual_sq = residual * residual;
        let limit = Lanes::splat(limits.distance_m) + Lanes::splat(limits.distance_sigmas) * sigma_b;
        let limit_sq = limit * limit;
        let is_inner = Lanes::load(&found.is_inner, at);
        // Where nothing was found the normal is 0, and with it the residual.
        for l in 0..LANES {
            let is_in_front = (residual.0[l] < 0.0) & (residual_sq.0[l] > 9.0 * variance.0[l]);
            in_front[l] += u32::from(is_in_front);
        }
        let keep: [bool; LANES] = from_fn(|l| {
            (is_inner.0[l] > 0.0) & (distance_sq.0[l] <= limit_sq.0[l]) & (cosine.0[l] >= limits.cosine)
        });
        let sigmas = (residual_sq / (variance + Lanes::splat(limits.pose_variance))).sqrt();
        // Memory may change after its check: what is rejected must not be able to poison a sum.
        found.e.store(at, e.map(|c| c.only(keep)));
        found.nb.store(at, nb.map(|c| c.only(keep)));
        found.na.store(at, na);
        distance_sq.store(&mut found.distance_sq, at);
        sigmas.store(&mut found.sigmas, at);
        (Lanes::splat(1.0) / variance).only(keep).store(&mut found.weight, at);
    }
    in_front.iter().sum()
}
