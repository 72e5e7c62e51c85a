//! Correspondences of one pair by projective search, and their sums (SPEC 4.2, 10).

use crate::accumulate::{Accumulate, Brightness};
use crate::block::BlockSums;
use crate::brightness;
use crate::descent::{self, Reach};
use crate::found::{Found, Judge, Limits};
use crate::locate::Located;
use crate::projection::GridCamera;
use crate::queries::{Chosen, Queries, Selection, Straighten};
use crate::settings::RegistrationSettings;
use crate::target::{ShutterTable, Target, flat};
use tessera_geometry::{DepthNoise, Pose};
use tessera_steps::{Step, Steps};

/// Limits of one outer iteration.
#[derive(Clone, Copy, Debug)]
pub struct MatchLimits {
    /// Largest distance at the start of the schedule, metres.
    pub first_distance_m: f32,
    /// 0 in the first outer iteration, 1 in the last: distances shrink from `first_distance_m`
    /// to twice the local edge tolerance, radii and normals from their first to their last value.
    pub progress: f32,
    /// Standard deviation that the error of the pose itself gives to a residual, metres; 0 where the
    /// pose is known as well as the surfaces are. While it is not, what stands apart from most
    /// matches is not an outlier: it may be the one thing that shows the error.
    pub pose_sigma_m: f32,
    /// Whether brightness counts beside geometry.
    pub brightness: bool,
}

impl MatchLimits {
    /// The limits at a point of the schedule, geometry alone.
    pub fn new(first_distance_m: f64, progress: f32) -> Self {
        Self { first_distance_m: first_distance_m as f32, progress, pose_sigma_m: 0.0, brightness: false }
    }

    /// The limits where drift may have carried the pose away by as much as `first_distance_m`: its
    /// error shrinks along the schedule, from a third of that to none.
    pub fn drifted(first_distance_m: f64, progress: f32) -> Self {
        let pose_sigma_m = first_distance_m as f32 / 3.0 * (1.0 - progress);
        Self { pose_sigma_m, ..Self::new(first_distance_m, progress) }
    }
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
    pub(crate) chosen: Chosen,
    located: Located,
    pub(crate) found: Found,
    residuals: Vec<f32>,
    /// For one-to-one: the place that holds a target vertex, valid where the stamp is current.
    holders: Vec<(u32, u32)>,
    stamp: u32,
    has_colour: bool,
    arch: pulp::Arch,
    /// Hears of the steps; nobody by default.
    pub steps: Steps,
}

/// Queries whose cells are read ahead at a time: what they bring fits the first cache.
const AHEAD: usize = 64;

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
            chosen: Chosen::default(),
            located: Located::default(),
            found: Found::default(),
            residuals: Vec::new(),
            holders,
            stamp: 0,
            has_colour: camera.has_colour,
            arch: settings.isa.arch(),
            steps: Steps::default(),
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
        self.steps.enter(Step::Search);
        let motion = flat(target_from_query);
        let n_queries = self.chosen.choose(queries, selection);
        self.arch.dispatch(Straighten { chosen: &mut self.chosen, shutter: queries.shutter() });
        self.found.reset(self.chosen.len());
        self.locate(target, &motion);
        let with_brightness = limits.brightness && self.has_colour;
        // A floor keeps perfect data from rejecting everything but the median itself.
        let least_median = if limits.pose_sigma_m > 0.0 { 1.0 } else { 0.05 };
        let limits = self.limits(limits);
        let n_in_view = match target.tree {
            Some(tree) => {
                let noise = self.noise;
                self.search(n_queries, target, |matcher, place| {
                    let q = matcher.located.q.at(place);
                    let limit_m = limits.kept.distance_m + limits.kept.distance_sigmas * noise.sigma_m(q[2]);
                    tree.nearest(q, limit_m).map(|(vertex, _)| vertex)
                })
            }
            None => self.search(n_queries, target, |matcher, place| {
                if place % AHEAD == 0 {
                    let grid = matcher.camera.grid;
                    let places = place..(place + AHEAD).min(n_queries);
                    descent::read_ahead(
                        &target.surface,
                        places.filter_map(|p| matcher.located.cell(p, grid)),
                    );
                }
                let cell = matcher.located.cell(place, matcher.camera.grid)?;
                descent::nearest(&target.surface, cell, limits.reach, matcher.located.q_row.at(place))
            }),
        };
        self.steps.enter(Step::Reject);
        let n_in_front = self.arch.dispatch(Judge {
            found: &mut self.found,
            q: &self.located.q,
            points: &self.chosen.points,
            normals: &self.chosen.normals,
            motion: &motion,
            shutter: *target.shutter,
            noise: self.noise,
            limits: limits.kept,
        });
        if self.settings.search.one_to_one {
            self.keep_one_to_one();
        }
        let median_residual_sigmas = self.reject_by_median(least_median);
        let brightness = if with_brightness { self.brightness(target) } else { Brightness::default() };
        self.weigh();
        self.steps.enter(Step::Accumulate);
        let epsilon = self.settings.weight.covariance_epsilon;
        let sums = self.arch.dispatch(Accumulate {
            found: &self.found,
            points: &self.chosen.points,
            epsilon,
            brightness,
        });
        let n_queries = n_queries as u32;
        let n_matches = sums.n;
        (sums, PairReport { n_queries, n_in_view, n_matches, median_residual_sigmas, n_in_front })
    }

    /// What the schedule says now.
    fn limits(&self, limits: &MatchLimits) -> Schedule {
        let s = &self.settings.search;
        let blend = |first: f32, last: f32| first + (last - first) * limits.progress;
        Schedule {
            reach: Reach {
                steps: (blend(s.first_reach as f32, s.last_reach as f32) + 0.5) as u32,
                stride: if limits.progress > 0.0 { 1 } else { s.first_stride as usize },
            },
            kept: Limits {
                distance_m: blend(limits.first_distance_m, 0.0),
                // 2 eps_d(z) = 2 * 2 n sigma(z).
                distance_sigmas: blend(0.0, 4.0 * self.camera.grid.step as f32),
                cosine: blend(s.first_normal_cosine, s.last_normal_cosine),
                pose_variance: limits.pose_sigma_m * limits.pose_sigma_m,
            },
        }
    }

    /// Where the chosen queries fall in the target's grid.
    fn locate(&mut self, target: &Target<'_>, motion: &[f32; 12]) {
        let n = self.chosen.len();
        self.located.resize(n);
        let p = &self.chosen.points;
        self.arch.dispatch(Locate {
            located: &mut self.located,
            camera: self.camera,
            motion,
            shutter: *target.shutter,
            points: [&p.x[..n], &p.y[..n], &p.z[..n]],
        });
    }

    /// Puts down what `find` finds for the first `n` places, and counts it.
    #[inline(always)]
    fn search(&mut self, n: usize, target: &Target<'_>, find: impl Fn(&Self, usize) -> Option<usize>) -> u32 {
        let mut n_found = 0;
        for place in 0..n {
            if let Some(vertex) = find(self, place) {
                let v = &target.surface.vertices[vertex];
                self.found.put(place, vertex, self.camera.grid.width, v);
                n_found += 1;
            }
        }
        n_found
    }

    /// Each target vertex serves its nearest query only; the first among equals.
    fn keep_one_to_one(&mut self) {
        self.stamp = self.stamp.wrapping_add(1);
        if self.stamp == 0 {
            self.holders.fill((0, 0));
            self.stamp = 1;
        }
        let found = &mut self.found;
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

    /// The median residual, after taking out all that exceeds a multiple of it or of `least`.
    fn reject_by_median(&mut self, least: f32) -> f32 {
        let found = &mut self.found;
        self.residuals.clear();
        self.residuals.extend(found.sigmas.iter().zip(&found.weight).filter(|f| *f.1 > 0.0).map(|f| f.0));
        if self.residuals.is_empty() {
            return 0.0;
        }
        let middle = self.residuals.len() / 2;
        let (_, median, _) = self.residuals.select_nth_unstable_by(middle, f32::total_cmp);
        let median = *median;
        let factor = self.settings.search.median_factor;
        if factor > 0.0 {
            let limit = factor * median.max(least);
            for (weight, sigmas) in found.weight.iter_mut().zip(&found.sigmas) {
                *weight = if *sigmas <= limit { *weight } else { 0.0 };
            }
        }
        median
    }

    /// Brightness as a further residual of each match.
    fn brightness(&mut self, target: &Target<'_>) -> Brightness {
        let information = self.metric_factor() as f32;
        let sigma = self.settings.weight.brightness_sigma;
        brightness::gather(&mut self.found, &self.chosen, target, information, sigma)
    }

    fn weigh(&mut self) {
        let w = &self.settings.weight;
        let reference = self.noise.sigma_m(REFERENCE_DEPTH_M);
        let unit = 2.0 * reference * reference;
        let inverse = if w.robust_sigmas > 0.0 { 1.0 / w.robust_sigmas } else { 0.0 };
        for (weight, sigmas) in self.found.weight.iter_mut().zip(&self.found.sigmas) {
            let r = *sigmas * inverse;
            let plain = if w.noise_scaled { unit * *weight } else { 1.0 };
            *weight = if *weight > 0.0 { plain / (1.0 + r * r) } else { 0.0 };
        }
    }
}

/// The schedule's limits in one outer iteration.
#[derive(Clone, Copy, Debug)]
struct Schedule {
    reach: Reach,
    kept: Limits,
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
