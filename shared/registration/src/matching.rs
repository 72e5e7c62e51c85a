//! Correspondences of one pair by projective search, and their sums (SPEC 4.2, 10).

use crate::accumulate::{Accumulate, Match};
use crate::block::BlockSums;
use crate::locate::Located;
use crate::projection::GridCamera;
use crate::queries::{Queries, Selection};
use crate::settings::RegistrationSettings;
use crate::target::{ShutterTable, Target, flat, rotate};
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

/// Searches and sums; holds its buffers.
pub struct Matcher {
    camera: GridCamera,
    noise: DepthNoise,
    settings: RegistrationSettings,
    chosen: Queries,
    located: Located,
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
            chosen: Queries::default(),
            located: Located::default(),
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

    /// Matches the selected queries against a target and sums them up.
    ///
    /// `target_from_query` maps the query frame (at its stamp) into the target's (at its stamp);
    /// the sums are about it.
    pub fn match_pair(
        &mut self,
        queries: &Queries,
        selection: Selection,
        target: &Target<'_>,
        target_from_query: &Pose,
        limits: &MatchLimits,
    ) -> (BlockSums, PairReport) {
        let mut report = PairReport::default();
        self.search(queries, selection, target, target_from_query, limits, &mut report);
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

    /// The matches of the last call of [`Self::match_pair`].
    pub fn matches(&self) -> &[Match] {
        &self.matches
    }

    fn search(
        &mut self,
        queries: &Queries,
        selection: Selection,
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
        self.chosen.choose(queries, selection);
        let n = self.chosen.len();
        report.n_queries = n as u32;
        self.located.resize(n);
        let p = &self.chosen.points;
        self.arch.dispatch(Locate {
            located: &mut self.located,
            camera: self.camera,
            motion: &motion,
            shutter: *target.shutter,
            points: [&p.x[..n], &p.y[..n], &p.z[..n]],
        });
        self.matches.clear();
        for place in 0..n {
            let Some((row, column)) = self.located.cell(place, grid) else { continue };
            let q_row = self.located.q_row.at(place);
            let Some((vertex, distance_sq)) = nearest(target, grid, row, column, reach, q_row) else {
                continue;
            };
            report.n_in_view += 1;
            let v = &target.surface.vertices[vertex];
            let (a, q) = (self.chosen.points.at(place), self.located.q.at(place));
            let sigma_b = self.noise.sigma_m(v.position[2]);
            let sigma_a = self.noise.sigma_m(a[2]);
            let (b, nb) = if target.shutter.is_global() {
                (v.position, v.normal)
            } else {
                let seconds = target.shutter.row_time_s((vertex / grid.width) as f32);
                (target.shutter.move_point(v.position, seconds), target.shutter.turn(v.normal, seconds))
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
            let na = rotate(&motion, self.chosen.normals.at(place));
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

/// The vector part of the search, compiled for each instruction set.
struct Locate<'a> {
    located: &'a mut Located,
    camera: GridCamera,
    motion: &'a [f32; 12],
    shutter: ShutterTable,
    points: [&'a [f32]; 3],
}

impl pulp::WithSimd for Locate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        self.located.fill(self.camera, self.motion, self.shutter, self.points);
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
    // Squared distance and place in one number: distances are not negative, so their bits order as
    // they do, and the least of these numbers needs no branch to find.
    let mut best = u64::MAX;
    let mut middle = (row, column);
    for _ in 0..reach.max(1) {
        let (top, bottom) = (middle.0.saturating_sub(1), (middle.0 + 1).min(grid.height - 1));
        let (left, right) = (middle.1.saturating_sub(1), (middle.1 + 1).min(grid.width - 1));
        for r in top..=bottom {
            let start = r * grid.width + left;
            for (c, v) in target.surface.vertices[start..=start + right - left].iter().enumerate() {
                let d = [v.position[0] - q[0], v.position[1] - q[1], v.position[2] - q[2]];
                let distance_sq = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                let bits = if v.is_valid() { distance_sq.to_bits() } else { u32::MAX };
                best = best.min(u64::from(bits) << 32 | (start + c) as u64);
            }
        }
        // Nothing valid here, or a distance that is no number.
        if (best >> 32) as u32 > f32::INFINITY.to_bits() {
            return None;
        }
        let vertex = best as u32 as usize;
        if vertex == middle.0 * grid.width + middle.1 {
            break;
        }
        middle = (vertex / grid.width, vertex % grid.width);
    }
    Some((best as u32 as usize, f32::from_bits((best >> 32) as u32)))
}
