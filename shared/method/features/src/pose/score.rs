//! The score of a hypothesis over all correspondences, eight at a time.

use super::correspondence::Correspondence;
use tessera_geometry::Pose;

const LANES: usize = 8;
/// Nearest depth of a point in front of a camera, metres.
const MIN_DEPTH_M: f32 = 0.01;

/// Points of one camera that the other one sees, as columns padded to whole lanes.
#[derive(Clone, Debug, Default)]
struct Columns {
    point: [Vec<f32>; 3],
    ray: [Vec<f32>; 2],
    depth: Vec<f32>,
    /// Inverse variances over the squared limit; depth 0 where the seeing camera has none.
    ray_weight: Vec<f32>,
    depth_weight: Vec<f32>,
    /// 1, and 0 in the padding.
    gain: Vec<f32>,
}

/// Scored points: those of the query seen by the target, and the other way round where only the
/// target has a point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Scored {
    forward: Columns,
    backward: Columns,
}

/// Truncated quadratic score (MSAC, Torr and Zisserman 2000) and number of inliers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Score {
    pub(crate) value: f32,
    pub(crate) n_inliers: usize,
}

impl Scored {
    /// Takes over the correspondences; errors count in units of `limit_sigmas`.
    ///
    /// Uncertainty here does not turn with the pose: the error along the target's depth and that
    /// across it count each with the sum of both sides' variances. The refinement is exact.
    pub(crate) fn fill(&mut self, correspondences: &[Correspondence], limit_sigmas: f64) {
        self.forward.clear();
        self.backward.clear();
        let per_limit = 1.0 / (limit_sigmas * limit_sigmas);
        for c in correspondences {
            let variance = c.query.ray_sigma * c.query.ray_sigma + c.target.ray_sigma * c.target.ray_sigma;
            let ray_weight = per_limit / variance;
            match (&c.query.point, &c.target.point) {
                (Some(q), Some(t)) => {
                    let variance = q.covariance_m2[(2, 2)] + t.covariance_m2[(2, 2)];
                    let depth = [t.position_m.z, per_limit / variance];
                    self.forward.push(q.position_m.into(), c.target.ray, ray_weight, depth);
                }
                (Some(q), None) => self.forward.push(q.position_m.into(), c.target.ray, ray_weight, [0.0; 2]),
                (None, Some(t)) => self.backward.push(t.position_m.into(), c.query.ray, ray_weight, [0.0; 2]),
                (None, None) => {}
            }
        }
        self.forward.pad();
        self.backward.pad();
    }

    #[inline(always)]
    pub(crate) fn score(&self, target_from_query: &Pose) -> Score {
        let [forward, backward] =
            [self.forward.score(target_from_query), self.backward.score(&target_from_query.inverse())];
        Score { value: forward.value + backward.value, n_inliers: forward.n_inliers + backward.n_inliers }
    }
}

impl Columns {
    fn all(&mut self) -> [&mut Vec<f32>; 9] {
        let ([x, y, z], [u, v]) = (&mut self.point, &mut self.ray);
        [x, y, z, u, v, &mut self.depth, &mut self.ray_weight, &mut self.depth_weight, &mut self.gain]
    }

    fn clear(&mut self) {
        self.all().into_iter().for_each(Vec::clear);
    }

    fn push(&mut self, [x, y, z]: [f64; 3], [u, v]: [f64; 2], weight: f64, [depth, depth_weight]: [f64; 2]) {
        let values = [x, y, z, u, v, depth, weight, depth_weight, 1.0];
        self.all().into_iter().zip(values).for_each(|(column, value)| column.push(value as f32));
    }

    fn pad(&mut self) {
        let n = self.gain.len().next_multiple_of(LANES);
        self.all().into_iter().for_each(|column| column.resize(n, 0.0));
    }

    #[inline(always)]
    fn score(&self, pose: &Pose) -> Score {
        let r = pose.rotation.to_rotation_matrix().into_inner().map(|v| v as f32);
        let t = pose.translation.vector.map(|v| v as f32);
        let (mut value, mut n_inliers) = ([0.0f32; LANES], [0u32; LANES]);
        for first in (0..self.gain.len()).step_by(LANES) {
            let run = |column: &Vec<f32>| -> [f32; LANES] {
                column[first..].first_chunk().copied().unwrap_or([0.0; LANES])
            };
            let ([x, y, z], [u, v]) = (self.point.each_ref().map(run), self.ray.each_ref().map(run));
            let (depth, ray_weight) = (run(&self.depth), run(&self.ray_weight));
            let (depth_weight, gain) = (run(&self.depth_weight), run(&self.gain));
            for l in 0..LANES {
                let p = [0, 1, 2].map(|k| r[(k, 0)] * x[l] + r[(k, 1)] * y[l] + r[(k, 2)] * z[l] + t[k]);
                let inverse = 1.0 / p[2];
                let (du, dv, dz) = (p[0] * inverse - u[l], p[1] * inverse - v[l], p[2] - depth[l]);
                let error = (du * du + dv * dv) * ray_weight[l] + dz * dz * depth_weight[l];
                let is_inlier = (error < 1.0) & (p[2] > MIN_DEPTH_M) & (gain[l] > 0.0);
                value[l] += if is_inlier { 1.0 - error } else { 0.0 };
                n_inliers[l] += u32::from(is_inlier);
            }
        }
        Score { value: value.iter().sum(), n_inliers: n_inliers.iter().sum::<u32>() as usize }
    }
}
