//! Data association of one pair and the sums of its GICP term (method 4.2, 10).

use crate::association::descent;
use crate::association::found::Found;
use crate::association::limits::MatchLimits;
use crate::association::projection::GridCamera;
use crate::association::projective_search::{Located, SeenBy};
use crate::association::queries::{Chosen, Queries, Selection, Straighten};
use crate::association::readout::{ReadoutSums, SumReadout};
use crate::association::rejection::{self, Reject, Rejection};
use crate::association::target::{Target, flat};
use crate::gicp::Accumulate;
use crate::settings::RegistrationSettings;
use tessera_geometry::{DepthNoise, Pose};
use tessera_graph::HalfSums;
use tessera_numerics::{Step, Steps};

/// Counts of a search.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PairReport {
    /// Queries tried.
    pub n_queries: u32,
    /// Queries that fell on a measured part of the target.
    pub n_in_view: u32,
    /// Of these, queries that fell within its surface, where a match may be.
    pub n_within: u32,
    /// Matches kept.
    pub n_matches: u32,
    /// Median of the normal residual over its standard deviation.
    pub median_residual_sigmas: f32,
    /// Queries that lie more than three standard deviations in front of the target's surface.
    pub n_in_front: u32,
}

impl PairReport {
    /// Share of the queries that are in view.
    pub fn in_view(&self) -> f64 {
        share(self.n_in_view, self.n_queries)
    }

    /// Share of those within the target's surface that have a match.
    pub fn matched_within(&self) -> f64 {
        share(self.n_matches, self.n_within)
    }

    /// Share of those in view that are in front.
    pub fn in_front(&self) -> f64 {
        share(self.n_in_front, self.n_in_view)
    }

    /// Share of all queries that have a match.
    pub fn overlap(&self) -> f64 {
        share(self.n_matches, self.n_queries)
    }
}

fn share(part: u32, whole: u32) -> f64 {
    f64::from(part) / f64::from(whole.max(1))
}

/// Searches and sums; holds its buffers.
pub struct Matcher {
    own_camera: GridCamera,
    /// That of the present target.
    camera: GridCamera,
    noise: DepthNoise,
    settings: RegistrationSettings,
    pub(crate) chosen: Chosen,
    /// Queries among them: the rest fills the lanes.
    n_chosen: usize,
    located: Located,
    pub(crate) found: Found,
    rejection: Rejection,
    arch: pulp::Arch,
    /// Observer of the steps; none by default.
    pub steps: Steps,
}

/// So many queries before a query's turn its cells are asked for: a microsecond, in which they come
/// from any cache or memory.
const AHEAD: usize = 16;

/// Depth at which a correspondence has weight one.
const REFERENCE_DEPTH_M: f32 = 1.0;

impl Matcher {
    /// A matcher for surfaces of one camera, beside those whose [`Target::shutter`] names another.
    pub fn new(camera: GridCamera, noise: DepthNoise, settings: &RegistrationSettings) -> Self {
        Self {
            own_camera: camera,
            camera,
            noise,
            settings: settings.clone(),
            chosen: Chosen::default(),
            n_chosen: 0,
            located: Located::default(),
            found: Found::default(),
            rejection: Rejection::new(camera.grid.len()),
            arch: settings.isa.arch(),
            steps: Steps::default(),
        }
    }

    /// Variance of a correspondence's normal residual at weight one, over epsilon: the factor
    /// that makes an inverse information matrix metric (method 9.3).
    pub fn metric_factor(&self) -> f64 {
        let sigma = f64::from(self.noise.sigma_m(REFERENCE_DEPTH_M));
        sigma * sigma / f64::from(self.settings.covariance_epsilon())
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
    ) -> (HalfSums, PairReport) {
        self.choose(queries, selection);
        self.match_chosen(target, target_from_query, limits)
    }

    /// Chooses queries for [`Self::match_chosen`].
    pub fn choose(&mut self, queries: &Queries, selection: Selection) {
        self.steps.enter(Step::Search);
        self.n_chosen = self.chosen.choose(queries, selection);
        self.arch.dispatch(Straighten { chosen: &mut self.chosen, shutter: queries.shutter() });
    }

    /// As [`Self::match_pair`], with the queries chosen last: they are the same at each pose of a pair.
    pub fn match_chosen(
        &mut self,
        target: &Target<'_>,
        target_from_query: &Pose,
        limits: &MatchLimits,
    ) -> (HalfSums, PairReport) {
        self.steps.enter(Step::Search);
        let (motion, n_queries) = (flat(target_from_query), self.n_chosen);
        self.camera = target.shutter.camera().unwrap_or(self.own_camera);
        self.rejection.make_room(self.camera.grid.len());
        self.found.resize(self.chosen.len());
        self.locate(target, &motion);
        let limits = limits.at(self.camera.grid.step);
        let n_in_view = match target.tree {
            Some(tree) => {
                let noise = self.noise;
                self.search(n_queries, target, |matcher, place| {
                    let q = matcher.located.q.at(place);
                    let limit_m = limits.kept.distance_m + limits.kept.distance_sigmas * noise.sigma_m(q[2]);
                    let width = matcher.camera.grid.width;
                    tree.nearest(q, limit_m).map(|(vertex, _)| (vertex / width, vertex % width))
                })
            }
            None => {
                let arch = self.arch;
                arch.dispatch(Descend { matcher: self, n_queries, target, reach: limits.reach })
            }
        };
        self.steps.enter(Step::Reject);
        let [n_within, n_in_front] = self.arch.dispatch(Reject {
            found: &mut self.found,
            q: &self.located.q,
            points: &self.chosen.points,
            normals: &self.chosen.normals,
            motion: &motion,
            shutter: *target.shutter,
            noise: self.noise,
            limits: limits.kept,
        });
        self.rejection.keep_one_to_one(&mut self.found);
        let median_residual_sigmas = self.rejection.by_median(&mut self.found, limits.least_median);
        let reference_sigma_m = self.noise.sigma_m(REFERENCE_DEPTH_M);
        rejection::weigh(&mut self.found, self.settings.variant, reference_sigma_m);
        self.steps.enter(Step::Accumulate);
        let epsilon = self.settings.covariance_epsilon();
        let accumulate = Accumulate { found: &self.found, points: &self.chosen.points, epsilon };
        let sums = self.arch.dispatch(accumulate);
        let n_queries = n_queries as u32;
        let n_matches = sums.upper.n + sums.lower.n;
        (sums, PairReport { n_queries, n_in_view, n_within, n_matches, median_residual_sigmas, n_in_front })
    }

    /// What the matches found last, by this target and pose, tell of the readout.
    pub fn readout_sums(
        &self,
        queries: &Queries,
        target: &Target<'_>,
        target_from_query: &Pose,
    ) -> ReadoutSums {
        self.arch.dispatch(SumReadout {
            found: &self.found,
            chosen: &self.chosen,
            q: &self.located.q,
            motion: &flat(target_from_query),
            query: queries.shutter(),
            target: *target.shutter,
            n_rows: [self.own_camera, self.camera].map(|camera| camera.grid.height as f32),
            epsilon: self.settings.covariance_epsilon(),
        })
    }

    /// Where the chosen queries fall in the target's grid.
    fn locate(&mut self, target: &Target<'_>, motion: &[f32; 12]) {
        let n = self.chosen.len();
        self.located.resize(n);
        let p = &self.chosen.points;
        self.arch.dispatch(Locate {
            located: &mut self.located,
            seen_by: SeenBy { camera: self.camera, target_from_query: motion, shutter: *target.shutter },
            points: [&p.x[..n], &p.y[..n], &p.z[..n]],
        });
    }

    #[inline(always)]
    fn read_ahead(&self, target: &Target<'_>, place: usize) {
        if let Some(cell) = self.located.cell(place) {
            descent::read_ahead(&target.surface, cell);
        }
    }

    /// Puts down what `find` finds for the first `n` places, and counts it.
    #[inline(always)]
    fn search(
        &mut self,
        n: usize,
        target: &Target<'_>,
        find: impl Fn(&Self, usize) -> Option<(usize, usize)>,
    ) -> u32 {
        let mut n_found = 0;
        for place in 0..n {
            if let Some((row, column)) = find(self, place) {
                let vertex = row * self.camera.grid.width + column;
                self.found.put(place, vertex, row, &target.surface.vertices[vertex]);
                n_found += 1;
            } else {
                self.found.leave(place);
            }
        }
        (n..self.found.len()).for_each(|place| self.found.leave(place));
        n_found
    }
}

/// The projective search of all queries, compiled for each instruction set.
struct Descend<'a, 'b> {
    matcher: &'a mut Matcher,
    n_queries: usize,
    target: &'a Target<'b>,
    reach: u32,
}

impl pulp::WithSimd for Descend<'_, '_> {
    /// Queries that found a vertex.
    type Output = u32;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> u32 {
        let Self { matcher, n_queries, target, reach } = self;
        (0..AHEAD.min(n_queries)).for_each(|place| matcher.read_ahead(target, place));
        matcher.search(n_queries, target, |matcher, place| {
            if place + AHEAD < n_queries {
                matcher.read_ahead(target, place + AHEAD);
            }
            let cell = matcher.located.cell(place)?;
            descent::nearest(&target.surface, cell, reach, matcher.located.q_row.at(place))
        })
    }
}

/// The vector part of the search, compiled for each instruction set.
struct Locate<'a> {
    located: &'a mut Located,
    seen_by: SeenBy<'a>,
    points: [&'a [f32]; 3],
}

impl pulp::WithSimd for Locate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        self.located.fill(&self.seen_by, self.points);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::association::target::ShutterTable;
    use crate::sampling::Sample;
    use tessera_geometry::{Camera, Twist};
    use tessera_numerics::SplitMix64;
    use tessera_surface::{Grid, SurfaceView, Vertex};

    /// A rough wall with holes, as a surface and as queries.
    fn wall(random: &mut SplitMix64, camera: &Camera, grid: Grid) -> (Vec<Vertex>, Vec<Sample>) {
        let mut vertices = Vec::new();
        for at in 0..grid.len() {
            let (row, column) = (at / grid.width, at % grid.width);
            let z = 2.0 + 0.001 * random.below(20) as f32;
            let ray = camera.ray((row * grid.step) as f64, (column * grid.step) as f64);
            vertices.push(Vertex {
                position: [ray.x as f32 * z, ray.y as f32 * z, z],
                flags_rgb: Vertex::pack(if random.below(5) == 0 { 0 } else { Vertex::VALID }, 0, [0; 3]),
                normal: [0.0, 0.0, -1.0],
                ..Vertex::default()
            });
        }
        let sample = |at: usize| Sample {
            point: vertices[at].position,
            normal: vertices[at].normal,
            grid_row: (at / grid.width) as u16,
        };
        let samples = (0..grid.len()).step_by(7).map(sample).collect();
        (vertices, samples)
    }

    #[test]
    fn what_was_matched_before_leaves_no_trace() {
        let camera =
            Camera { readout_s: 0.03, ..Camera::pinhole((160, 120), [131.0, 131.0, 79.5, 59.5], 5000.0) };
        let grid = Grid { width: 40, height: 30, step: 4 };
        let matcher = || {
            let camera = GridCamera::new(&camera, grid, 0.0);
            Matcher::new(camera, DepthNoise::default(), &RegistrationSettings::default())
        };
        let mut random = SplitMix64::for_frame(7, 6);
        let twist = Twist { rho: nalgebra::Vector3::new(0.2, 0.1, 0.0), ..Twist::default() };
        let shutter = ShutterTable::new(&camera, &twist, grid.height, grid.step, 0.0);
        let limits = MatchLimits::new(0.1, 0.5);
        let mut used = matcher();
        for (count, away_m) in [(200, 0.02), (61, 0.3), (170, 40.0), (99, -0.1), (3, 0.0), (200, 0.05)] {
            let (vertices, samples) = wall(&mut random, &camera, grid);
            let target =
                Target { surface: SurfaceView { grid, vertices: &vertices }, shutter: &shutter, tree: None };
            let mut queries = Queries::default();
            queries.fill(&samples, &shutter);
            let selection = Selection { count, shift: 3 };
            let at = |x: f64| Pose::translation(x, 0.01, 0.002);
            let expected = [at(away_m), at(0.5 * away_m)]
                .map(|pose| matcher().match_pair(&queries, selection, &target, &pose, &limits));
            assert_eq!(used.match_pair(&queries, selection, &target, &at(away_m), &limits), expected[0]);
            assert_eq!(used.match_chosen(&target, &at(0.5 * away_m), &limits), expected[1]);
            assert!(
                away_m.abs() > 1.0 || count < 9 || expected[0].0.all().n > 5,
                "{count}: {:?}",
                expected[0].1
            );
        }
    }

    #[test]
    fn a_target_of_another_camera_is_matched_as_by_a_matcher_of_that_camera() {
        let near = Camera::pinhole((160, 120), [131.0, 131.0, 79.5, 59.5], 5000.0);
        let far = Camera::pinhole((212, 124), [154.0, 150.0, 104.0, 60.0], 5000.0);
        let near_grid = Grid { width: 40, height: 30, step: 4 };
        let far_grid = Grid { width: 53, height: 31, step: 4 };
        let matcher = |camera: &Camera, grid| {
            let camera = GridCamera::new(camera, grid, 1.5);
            Matcher::new(camera, DepthNoise::default(), &RegistrationSettings::default())
        };
        let of = |camera: &Camera, grid: Grid| {
            ShutterTable::new(camera, &Twist::default(), grid.height, grid.step, 1.5)
        };
        let mut random = SplitMix64::for_frame(7, 6);
        let [(_, samples), (vertices, _)] =
            [(&near, near_grid), (&far, far_grid)].map(|(camera, grid)| wall(&mut random, camera, grid));
        let mut queries = Queries::default();
        queries.fill(&samples, &of(&near, near_grid));
        let selection = Selection { count: 150, shift: 3 };
        let (pose, limits) = (Pose::translation(0.02, 0.01, 0.002), MatchLimits::new(0.1, 0.5));
        let surface = SurfaceView { grid: far_grid, vertices: &vertices };
        let shutter = of(&far, far_grid);
        let target = Target { surface, shutter: &shutter, tree: None };
        let expected = matcher(&far, far_grid).match_pair(&queries, selection, &target, &pose, &limits);
        let named = shutter.of_camera(GridCamera::new(&far, far_grid, 1.5));
        let target = Target { shutter: &named, ..target };
        let found = matcher(&near, near_grid).match_pair(&queries, selection, &target, &pose, &limits);
        assert!(found.0.all().n > 50, "{:?}", found.1);
        assert_eq!(found, expected);
    }
}
