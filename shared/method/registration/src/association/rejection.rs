//! Rejection of outliers, and the weights of what remains (III-I; method 10.3, 10.4).

use crate::association::columns::Columns3;
use crate::association::found::Found;
use crate::association::limits::Limits;
use crate::association::target::ShutterTable;
use std::array::from_fn;
use tessera_geometry::DepthNoise;
use tessera_numerics::MethodVariant;
use tessera_numerics::lanes::{LANES, Lanes, Real, dot, rotate, sub};

/// Factor of the median residual beyond which a correspondence is an outlier (method 10.3).
const MEDIAN_FACTOR: f32 = 3.0;

/// Turns what was found into residuals and weights, eight places at a time.
pub(crate) struct Reject<'a> {
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

impl pulp::WithSimd for Reject<'_> {
    /// Queries within the target's surface, and those more than three standard deviations in front of it.
    type Output = [u32; 2];

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> [u32; 2] {
        if self.shutter.is_global() { reject::<false>(self) } else { reject::<true>(self) }
    }
}

#[inline(always)]
fn reject<const IS_ROLLING: bool>(it: Reject<'_>) -> [u32; 2] {
    let Reject { found, q, points, normals, motion, shutter, noise, limits } = it;
    let sigma = |z: Lanes| z.map(|z| noise.sigma_m(z));
    let (mut within, mut in_front) = ([0u32; LANES], [0u32; LANES]);
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
            within[l] += u32::from(is_inner.0[l] > 0.0);
        }
        let keep: [bool; LANES] = from_fn(|l| {
            (is_inner.0[l] > 0.0) & (distance_sq.0[l] <= limit_sq.0[l]) & (cosine.0[l] >= limits.cosine)
        });
        let sigmas = (residual_sq / (variance + Lanes::splat(limits.pose_variance))).sqrt();
        // Memory may change after its check: what is rejected must not be able to poison a sum.
        found.e.store(at, only(e, keep));
        found.nb.store(at, only(nb, keep));
        found.na.store(at, na);
        distance_sq.store(&mut found.distance_sq, at);
        sigmas.store(&mut found.sigmas, at);
        (Lanes::splat(1.0) / variance).only(keep).store(&mut found.weight, at);
    }
    [within, in_front].map(|counts| counts.iter().sum())
}

/// No closure: it would be compiled apart, for the oldest processors.
#[inline(always)]
fn only(v: [Lanes; 3], keep: [bool; LANES]) -> [Lanes; 3] {
    [v[0].only(keep), v[1].only(keep), v[2].only(keep)]
}

/// Rejection that compares matches with each other; holds its buffers.
#[derive(Debug, Default)]
pub(crate) struct Rejection {
    residuals: Vec<f32>,
    /// For one-to-one: the place that holds a target vertex, valid where the stamp is current.
    holders: Vec<(u32, u32)>,
    stamp: u32,
}

impl Rejection {
    /// For targets with `n_vertices` vertices.
    pub(crate) fn new(n_vertices: usize) -> Self {
        Self { holders: vec![(0, 0); n_vertices], ..Self::default() }
    }

    /// For a target with so many vertices, which may be of another camera.
    pub(crate) fn make_room(&mut self, n_vertices: usize) {
        if self.holders.len() < n_vertices {
            // A stamp of 0 is never current.
            self.holders.resize(n_vertices, (0, 0));
        }
    }

    /// Keeps for each target vertex its nearest query only; the first among equals.
    pub(crate) fn keep_one_to_one(&mut self, found: &mut Found) {
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.holders.fill((0, 0));
            self.stamp = 1;
        }
        for k in 0..found.len() {
            if found.weight[k] <= 0.0 {
                continue;
            }
            let holder = &mut self.holders[found.vertex[k] as usize];
            if holder.0 != self.stamp {
                *holder = (self.stamp, k as u32);
            } else if found.distance_sq[k] < found.distance_sq[holder.1 as usize] {
                found.weight[holder.1 as usize] = 0.0;
                holder.1 = k as u32;
            } else {
                found.weight[k] = 0.0;
            }
        }
    }

    /// The median residual, after rejecting all that exceed three times it or three times `least`.
    pub(crate) fn by_median(&mut self, found: &mut Found, least: f32) -> f32 {
        // Without a branch: each is put down, and overwritten by the next one unless it counts.
        self.residuals.resize(found.sigmas.len(), 0.0);
        let mut n = 0;
        for (sigmas, weight) in found.sigmas.iter().zip(&found.weight) {
            self.residuals[n] = *sigmas;
            n += usize::from(*weight > 0.0);
        }
        if n == 0 {
            return 0.0;
        }
        let (_, median, _) = self.residuals[..n].select_nth_unstable_by(n / 2, f32::total_cmp);
        let median = *median;
        let limit = MEDIAN_FACTOR * median.max(least);
        for (weight, sigmas) in found.weight.iter_mut().zip(&found.sigmas) {
            *weight = if *sigmas <= limit { *weight } else { 0.0 };
        }
        median
    }
}

/// Turns inverse variances into weights: `w = (2 sigma(1 m)^2 / variance) / (1 + (r/c)^2)`, the noise
/// model and the Cauchy kernel on the normal residual with `c` = 1 deviation of depth; the paper has neither.
pub(crate) fn weigh(found: &mut Found, variant: MethodVariant, reference_sigma_m: f32) {
    let unit = 2.0 * reference_sigma_m * reference_sigma_m;
    let inverse = if variant.is_paper() { 0.0 } else { 1.0 };
    for (weight, sigmas) in found.weight.iter_mut().zip(&found.sigmas) {
        let r = *sigmas * inverse;
        let plain = if variant.is_paper() { 1.0 } else { unit * *weight };
        *weight = if *weight > 0.0 { plain / (1.0 + r * r) } else { 0.0 };
    }
}
