//! Correspondences of one pair by projective search, and their sums (SPEC 4.2, 10).

use crate::block::BlockSums;
use crate::projection::GridCamera;
use crate::queries::Queries;
use crate::settings::RegistrationSettings;
use crate::target::{Target, flat, rotate, transform, transform_inverse};
use std::ops::Range;
use tessera_geometry::{DepthNoise, Pose};
use tessera_surface::Grid;

/// Limits of one outer iteration.
#[derive(Clone, Copy, Debug)]
pub struct MatchLimits {
    /// Largest distance at the start of the schedule, metres.
    pub first_distance_m: f32,
    /// 0 in the first outer iteration, 1 in the last: distances shrink from `first_distance_m`
    /// to twice the local edge tolerance, radii and normals from their first to their last value.
    pub progress: f32,
}

/// What a search found, in numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PairReport {
    /// Queries tried.
    pub n_queries: u32,
    /// Queries that fell on a measured part of the target.
    pub n_in_view: u32,
    /// Matches kept.
    pub n_matches: u32,
    /// Median of the normal residual over its standard deviation.
    pub median_residual_sigmas: f32,
    /// Queries that lie more than three standard deviations in front of the target's surface.
    pub n_in_front: u32,
}

#[derive(Clone, Copy, Debug)]
struct Match {
    /// Query point in its own frame.
    a: [f32; 3],
    /// Residual `b - T a` in the target's frame.
    e: [f32; 3],
    /// Query's normal in the target's frame.
    na: [f32; 3],
    nb: [f32; 3],
    vertex: u32,
    distance_sq: f32,
    /// Normal residual in standard deviations.
    sigmas: f32,
    weight: f32,
}

impl Match {
    /// A match that counts nothing, to fill lanes up.
    const NONE: Self = Self {
        a: [0.0; 3],
        e: [0.0; 3],
        na: [0.0; 3],
        nb: [0.0; 3],
        vertex: 0,
        distance_sq: 0.0,
        sigmas: 0.0,
        weight: 0.0,
    };
}

/// Searches and sums; holds its buffers.
pub struct Matcher {
    camera: GridCamera,
    noise: DepthNoise,
    settings: RegistrationSettings,
    matches: Vec<Match>,
    residuals: Vec<f32>,
    /// For one-to-one: the match that holds a target vertex, valid where the stamp is current.
    holders: Vec<(u32, u32)>,
    stamp: u32,
    arch: pulp::Arch,
}

/// Depth at which a correspondence has weight one.
const REFERENCE_DEPTH_M: f32 = 1.0;

impl Matcher {
    /// A matcher for surfaces of one camera.
    pub fn new(camera: GridCamera, noise: DepthNoise, settings: &RegistrationSettings) -> Self {
        let holders = vec![(0, 0); camera.grid.len()];
        Self {
            camera,
            noise,
            settings: settings.clone(),
            matches: Vec::new(),
            residuals: Vec::new(),
            holders,
            stamp: 0,
            arch: pulp::Arch::new(),
        }
    }

    /// Variance of a correspondence's normal residual at weight one, over epsilon: the factor
    /// that makes an inverse information matrix metric (SPEC 9.3).
    pub fn metric_factor(&self) -> f64 {
        let sigma = f64::from(self.noise.sigma_m(REFERENCE_DEPTH_M));
        sigma * sigma / f64::from(self.settings.weight.covariance_epsilon)
    }

    /// Matches the queries of `range` against a target and sums them up.
    ///
    /// `target_from_query` maps the query frame (at its stamp) into the target's (at its stamp);
    /// the sums are about it.
    pub fn match_pair(
        &mut self,
        queries: &Queries,
        range: Range<usize>,
        target: &Target<'_>,
        target_from_query: &Pose,
        limits: &MatchLimits,
    ) -> (BlockSums, PairReport) {
        let mut report = PairReport { n_queries: range.len() as u32, ..PairReport::default() };
        self.search(queries, range, target, target_from_query, limits, &mut report);
        if self.settings.search.one_to_one {
            self.keep_one_to_one();
        }
        self.reject_by_median(&mut report);
        self.weigh();
        report.n_matches = self.matches.len() as u32;
        let epsilon = self.settings.weight.covariance_epsilon;
        let sums = self.arch.dispatch(Accumulate { matches: &self.matches, epsilon });
        (sums, report)
    }

    fn search(
        &mut self,
        queries: &Queries,
        range: Range<usize>,
        target: &Target<'_>,
        target_from_query: &Pose,
        limits: &MatchLimits,
        report: &mut PairReport,
    ) {
        let s = &self.settings.search;
        let blend = |first: f32, last: f32| first + (last - first) * limits.progress;
        let reach = (blend(s.first_reach as f32, s.last_reach as f32) + 0.5) as u32;
        let min_cosine = blend(s.first_normal_cosine, s.last_normal_cosine);
        let tolerance_factor = 4.0 * self.camera.grid.step as f32;
        let motion = flat(target_from_query);
        let grid = self.camera.grid;
        self.matches.clear();
        for k in range {
            let (a, n) = (queries.points[k], queries.normals[k]);
            let q = transform(&motion, a);
            let Some((row, column, q_row)) = self.locate(q, target) else { continue };
            let Some((vertex, distance_sq)) = nearest(target, grid, row, column, reach, q_row) else {
                continue;
            };
            report.n_in_view += 1;
            let v = &target.surface.vertices[vertex];
            let sigma_b = self.noise.sigma_m(v.position[2]);
            let sigma_a = self.noise.sigma_m(a[2]);
            let (b, nb) = if target.shutter.is_global() {
                (v.position, v.normal)
            } else {
                let stamp_from_row = target.shutter.row(vertex / grid.width);
                (transform(stamp_from_row, v.position), rotate(stamp_from_row, v.normal))
            };
            let e = [b[0] - q[0], b[1] - q[1], b[2] - q[2]];
            let variance = sigma_a * sigma_a + sigma_b * sigma_b;
            let residual = e[0] * nb[0] + e[1] * nb[1] + e[2] * nb[2];
            // A query in front of what the target saw there: free space was violated.
            if residual < 0.0 && residual * residual > 9.0 * variance {
                report.n_in_front += 1;
            }
            // 2 eps_d(z) = 2 * 2 n sigma(z).
            let limit = blend(limits.first_distance_m, tolerance_factor * sigma_b);
            let na = rotate(&motion, n);
            let cosine = na[0] * nb[0] + na[1] * nb[1] + na[2] * nb[2];
            if !v.is_inner() || !(distance_sq <= limit * limit) || !(cosine >= min_cosine) {
                continue;
            }
            self.matches.push(Match {
                a,
                e,
                na,
                nb,
                vertex: vertex as u32,
                distance_sq,
                sigmas: residual / variance.sqrt(),
                weight: 1.0 / variance,
            });
        }
    }

    /// Grid cell that sees `q`, and `q` in the frame of that row's exposure.
    #[inline]
    fn locate(&self, q: [f32; 3], target: &Target<'_>) -> Option<(usize, usize, [f32; 3])> {
        let (mut row, mut column) = self.camera.project(q)?;
        let mut q_row = q;
        if !target.shutter.is_global() {
            // Two fixed-point steps find the row whose exposure saw the point (SPEC 1.6).
            for _ in 0..2 {
                q_row = transform_inverse(target.shutter.row((row + 0.5).max(0.0) as usize), q);
                (row, column) = self.camera.project(q_row)?;
            }
        }
        // Rounded, not truncated (TRAPS 11).
        let (row, column) = (row + 0.5, column + 0.5);
        let inside = row >= 0.0
            && column >= 0.0
            && row < self.camera.grid.height as f32
            && column < self.camera.grid.width as f32;
        inside.then_some((row as usize, column as usize, q_row))
    }

    /// Each target vertex serves its nearest query only; the first among equals.
    fn keep_one_to_one(&mut self) {
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.holders.fill((0, 0));
            self.stamp = 1;
        }
        for k in 0..self.matches.len() {
            let m = self.matches[k];
            let holder = &mut self.holders[m.vertex as usize];
            if holder.0 != self.stamp {
                *holder = (self.stamp, k as u32);
            } else if m.distance_sq < self.matches[holder.1 as usize].distance_sq {
                self.matches[holder.1 as usize].weight = 0.0;
                holder.1 = k as u32;
            } else {
                self.matches[k].weight = 0.0;
            }
        }
        self.matches.retain(|m| m.weight > 0.0);
    }

    fn reject_by_median(&mut self, report: &mut PairReport) {
        if self.matches.is_empty() {
            return;
        }
        self.residuals.clear();
        self.residuals.extend(self.matches.iter().map(|m| m.sigmas.abs()));
        let middle = self.residuals.len() / 2;
        let (_, median, _) = self.residuals.select_nth_unstable_by(middle, f32::total_cmp);
        let median = *median;
        report.median_residual_sigmas = median;
        let factor = self.settings.search.median_factor;
        if factor > 0.0 {
            // A floor keeps perfect data from rejecting everything but the median itself.
            let limit = factor * median.max(0.05);
            self.matches.retain(|m| m.sigmas.abs() <= limit);
        }
    }

    fn weigh(&mut self) {
        let w = &self.settings.weight;
        let reference = self.noise.sigma_m(REFERENCE_DEPTH_M);
        let unit = 2.0 * reference * reference;
        for m in &mut self.matches {
            m.weight = if w.noise_scaled { unit * m.weight } else { 1.0 };
            if w.robust_sigmas > 0.0 {
                let r = m.sigmas / w.robust_sigmas;
                m.weight /= 1.0 + r * r;
            }
        }
    }
}

/// The valid vertex nearest to `q`, found by descent: the nearest of the 3x3 cells around a cell,
/// then around that one, until the middle is nearest or `reach` steps were taken. Near the
/// solution this reads nine vertices, whatever the reach.
#[inline(always)]
fn nearest(
    target: &Target<'_>,
    grid: Grid,
    row: usize,
    column: usize,
    reach: u32,
    q: [f32; 3],
) -> Option<(usize, f32)> {
    let mut best = (usize::MAX, f32::INFINITY);
    let mut middle = (row, column);
    for _ in 0..reach.max(1) {
        let (top, bottom) = (middle.0.saturating_sub(1), (middle.0 + 1).min(grid.height - 1));
        let (left, right) = (middle.1.saturating_sub(1), (middle.1 + 1).min(grid.width - 1));
        for r in top..=bottom {
            let start = r * grid.width;
            for (c, v) in target.surface.vertices[start + left..=start + right].iter().enumerate() {
                let d = [v.position[0] - q[0], v.position[1] - q[1], v.position[2] - q[2]];
                let distance_sq = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                if (distance_sq < best.1) & v.is_valid() {
                    best = (start + left + c, distance_sq);
                }
            }
        }
        if best.0 == usize::MAX {
            return None;
        }
        let found = (best.0 / grid.width, best.0 % grid.width);
        if found == middle {
            break;
        }
        middle = found;
    }
    Some(best)
}

/// Matches summed in one `f32` run before they go into `f64` sums.
const CHUNK: usize = 256;
/// Lanes of the sums: fixed, so that the bits do not depend on the machine.
const LANES: usize = 8;

/// The sums of SPEC 5.4 over all matches: `f32` lanes inside fixed chunks, `f64` across them.
/// Compiled for each instruction set; the lanes and the order are the same on all.
struct Accumulate<'a> {
    matches: &'a [Match],
    epsilon: f32,
}

impl pulp::WithSimd for Accumulate<'_> {
    type Output = BlockSums;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> BlockSums {
        accumulate(self.matches, self.epsilon)
    }
}

#[inline(always)]
fn accumulate(matches: &[Match], epsilon: f32) -> BlockSums {
    let mut sums = BlockSums { n: matches.len() as u32, ..BlockSums::default() };
    for chunk in matches.chunks(CHUNK) {
        let mut lanes = [[0.0f32; LANES]; 73];
        let (whole, rest) = chunk.as_chunks::<LANES>();
        for eight in whole {
            add_lanes(eight, epsilon, &mut lanes);
        }
        if !rest.is_empty() {
            let mut eight = [Match::NONE; LANES];
            eight[..rest.len()].copy_from_slice(rest);
            add_lanes(&eight, epsilon, &mut lanes);
        }
        let mut total = lanes.iter().map(|lane| lane.iter().map(|&v| f64::from(v)).sum::<f64>());
        for value in sums.q.iter_mut().chain(&mut sums.l).chain(std::iter::once(&mut sums.c)) {
            *value += total.next().unwrap_or(0.0);
        }
    }
    sums
}

type Lane = [f32; LANES];

#[inline(always)]
fn lane(f: impl Fn(usize) -> f32) -> Lane {
    std::array::from_fn(f)
}

/// Adds eight matches.
#[inline(always)]
fn add_lanes(matches: &[Match; LANES], epsilon: f32, sums: &mut [Lane; 73]) {
    let s = 1.0 - epsilon;
    let tilde =
        [lane(|l| matches[l].a[0]), lane(|l| matches[l].a[1]), lane(|l| matches[l].a[2]), [1.0; LANES]];
    let e = [lane(|l| matches[l].e[0]), lane(|l| matches[l].e[1]), lane(|l| matches[l].e[2])];
    let na = [lane(|l| matches[l].na[0]), lane(|l| matches[l].na[1]), lane(|l| matches[l].na[2])];
    let nb = [lane(|l| matches[l].nb[0]), lane(|l| matches[l].nb[1]), lane(|l| matches[l].nb[2])];
    let w = lane(|l| matches[l].weight);
    let u: [Lane; 3] = std::array::from_fn(|c| lane(|l| na[c][l] + nb[c][l]));
    let d: [Lane; 3] = std::array::from_fn(|c| lane(|l| na[c][l] - nb[c][l]));
    let dot = |x: &[Lane; 3], l: usize| x[0][l] * x[0][l] + x[1][l] * x[1][l] + x[2][l] * x[2][l];
    // SPEC 4.2: no inverse, no division by zero, and good to 1e-6 in f32.
    let plus = lane(|l| w[l] * 0.25 * s / (2.0 * epsilon + 0.5 * s * dot(&d, l)));
    let minus = lane(|l| w[l] * 0.25 * s / (2.0 * epsilon + 0.5 * s * dot(&u, l)));
    let entry = |r: usize, c: usize| {
        lane(|l| {
            let half = if r == c { 0.5 * w[l] } else { 0.0 };
            half + plus[l] * u[r][l] * u[c][l] + minus[l] * d[r][l] * d[c][l]
        })
    };
    let omega = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
    let oe = [
        lane(|l| omega[0][l] * e[0][l] + omega[1][l] * e[1][l] + omega[2][l] * e[2][l]),
        lane(|l| omega[1][l] * e[0][l] + omega[3][l] * e[1][l] + omega[4][l] * e[2][l]),
        lane(|l| omega[2][l] * e[0][l] + omega[4][l] * e[1][l] + omega[5][l] * e[2][l]),
    ];
    let mut at = 0;
    for k in 0..4 {
        for m in k..4 {
            let product = lane(|l| tilde[k][l] * tilde[m][l]);
            for o in &omega {
                for l in 0..LANES {
                    sums[at][l] += product[l] * o[l];
                }
                at += 1;
            }
        }
    }
    for t in &tilde {
        for component in &oe {
            for l in 0..LANES {
                sums[at][l] += t[l] * component[l];
            }
            at += 1;
        }
    }
    for l in 0..LANES {
        sums[72][l] += e[0][l] * oe[0][l] + e[1][l] * oe[1][l] + e[2][l] * oe[2][l];
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[test]
    fn the_closed_form_information_equals_the_inverse() {
        let epsilon = 1e-3f64;
        let normals = [
            (Vector3::new(0.0, 0.0, -1.0), Vector3::new(0.0, 0.0, -1.0)),
            (Vector3::new(0.6, 0.0, -0.8), Vector3::new(0.0, 0.0, -1.0)),
            (Vector3::new(0.6, 0.0, -0.8), Vector3::new(0.61, 0.02, -0.79).normalize()),
            (Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 1.0, 0.0)),
        ];
        for (na, nb) in normals {
            let e = Vector3::new(0.01, -0.02, 0.005);
            let m = Match {
                a: [0.0; 3],
                e: [e.x as f32, e.y as f32, e.z as f32],
                na: [na.x as f32, na.y as f32, na.z as f32],
                nb: [nb.x as f32, nb.y as f32, nb.z as f32],
                vertex: 0,
                distance_sq: 0.0,
                sigmas: 0.0,
                weight: 1.0,
            };
            let sums = accumulate(&[m], epsilon as f32);
            let sigma = |n: &Vector3<f64>| Matrix3::identity() - n * n.transpose() * (1.0 - epsilon);
            let exact = (sigma(&na) + sigma(&nb)).try_inverse().unwrap();
            // a~ = (0, 0, 0, 1): the last six of Q are Omega itself.
            let upper = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
            for (k, (r, c)) in upper.into_iter().enumerate() {
                let error = (sums.q[54 + k] - exact[(r, c)]).abs();
                assert!(error < 1e-5 * exact.norm(), "{na:?} {nb:?}: {error}");
            }
            assert!((sums.c - e.dot(&(exact * e))).abs() < 1e-4 * sums.c);
        }
    }
}
