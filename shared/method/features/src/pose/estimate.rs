//! The robust estimate: hypotheses, the best of them refined, and what it is worth.

use super::correspondence::Correspondence;
use super::linearise::{NormalEquations, RelativeMotion, linearise};
use super::refine::{limit_sq, refine};
use super::sample::Pools;
use super::score::{Score, Scored};
use crate::settings::PoseSettings;
use tessera_geometry::{Matrix6, Pose};
use tessera_numerics::SplitMix64;

/// A pose that many correspondences agree on.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseEstimate {
    /// Maps points of the query's camera to the target's camera.
    pub target_from_query: Pose,
    /// Indices of the inliers, ascending.
    pub inliers: Vec<u32>,
    /// Inliers with points on both sides (3D-3D).
    pub n_both: usize,
    /// Correspondences with a point on at least one side: those that could have agreed.
    pub n_usable: usize,
    /// Median over the inliers of the normalised error per dimension, standard deviations; about
    /// 0.8 where the stated uncertainty is right.
    pub median_error: f64,
    /// Information (inverse covariance) of `delta` in `target_from_query * exp(delta)`, from the
    /// inliers; translation first.
    pub information: Matrix6,
    /// Index of the initial guess that the estimate was refined from; `None`: a random sample.
    pub guess: Option<usize>,
    /// RANSAC iterations.
    pub n_iterations: u32,
}

/// Buffers of [`estimate_pose`], and the instruction set.
#[derive(Clone, Debug)]
pub struct PoseWorkspace {
    arch: pulp::Arch,
    pools: Pools,
    scored: Scored,
    poses: Vec<Pose>,
    errors: Vec<f64>,
}

impl PoseWorkspace {
    /// Buffers for loops compiled for `arch`; the instruction set does not change a bit of the result.
    pub fn new(arch: pulp::Arch) -> Self {
        let (pools, scored) = (Pools::default(), Scored::default());
        Self { arch, pools, scored, poses: Vec::new(), errors: Vec::new() }
    }
}

/// Robust relative pose: RANSAC over minimal samples and initial guesses, then iteratively
/// reweighted least squares.
///
/// Correspondences with two points count as 3D-3D, with one as 2D-3D, without any not at all.
/// `guesses` (`target_from_query`) are hypotheses beside the random ones; of equal scores the
/// earlier stands. `None` where fewer than `settings.min_inliers` agree or their pose is degenerate.
pub fn estimate_pose(
    correspondences: &[Correspondence],
    guesses: &[Pose],
    seed: u64,
    settings: &PoseSettings,
    workspace: &mut PoseWorkspace,
) -> Option<PoseEstimate> {
    workspace.pools.fill(correspondences);
    if workspace.pools.n_usable() < (settings.min_inliers as usize).max(3) {
        return None;
    }
    let arch = workspace.arch;
    arch.dispatch(Estimation { correspondences, guesses, seed, settings, w: workspace })
}

/// Inliers of a guess, and their share, from which on nothing else is looked for: what else agrees
/// on a motion of its own is a moving object.
const SURE_INLIERS: usize = 30;
const SURE_SHARE: f64 = 0.4;

struct Estimation<'a> {
    correspondences: &'a [Correspondence],
    guesses: &'a [Pose],
    seed: u64,
    settings: &'a PoseSettings,
    w: &'a mut PoseWorkspace,
}

impl pulp::WithSimd for Estimation<'_> {
    type Output = Option<PoseEstimate>;

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) -> Option<PoseEstimate> {
        let Self { correspondences, guesses, seed, settings, w } = self;
        // Hypotheses are rough: they are scored with twice the limit of the result.
        w.scored.fill(correspondences, 2.0 * settings.inlier_sigmas);
        let mut search = PoseSearch { correspondences, settings, w, best: BestPose::default() };
        for (index, guess) in guesses.iter().enumerate() {
            search.consider(guess, Some(index));
        }
        let n_iterations = if search.is_guess_sure() { 0 } else { search.sample(seed) };
        let BestPose { pose, score, guess } = search.best;
        if score.n_inliers < 3 {
            return None;
        }
        let pose = refine(correspondences, &pose, settings, settings.refine_iterations)?;
        judged(&pose, guess, n_iterations, correspondences, settings, w)
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct BestPose {
    pose: Pose,
    score: Score,
    guess: Option<usize>,
}

struct PoseSearch<'a> {
    correspondences: &'a [Correspondence],
    settings: &'a PoseSettings,
    w: &'a mut PoseWorkspace,
    best: BestPose,
}

impl PoseSearch<'_> {
    /// Whether a guess holds for so many that no sample needs to be drawn.
    fn is_guess_sure(&self) -> bool {
        let BestPose { score, guess, .. } = &self.best;
        let least = (SURE_SHARE * self.w.pools.n_usable() as f64) as usize;
        guess.is_some() && score.n_inliers >= SURE_INLIERS.max(least)
    }

    /// Keeps a hypothesis that beats the best one, and its local optimum where that is better still
    /// (LO-RANSAC, Chum, Matas and Kittler 2003).
    #[inline(always)]
    fn consider(&mut self, pose: &Pose, guess: Option<usize>) {
        let score = self.w.scored.score(pose);
        if !(score.value > self.best.score.value) {
            return;
        }
        self.best = BestPose { pose: *pose, score, guess };
        // The result is refined in any case.
        if score.n_inliers < self.settings.min_inliers as usize || self.is_guess_sure() {
            return;
        }
        if let Some(pose) = refine(self.correspondences, pose, self.settings, 2) {
            let score = self.w.scored.score(&pose);
            if score.value > self.best.score.value {
                self.best = BestPose { pose, score, guess };
            }
        }
    }

    /// Draws samples until an all-inlier one was drawn with the confidence asked for.
    #[inline(always)]
    fn sample(&mut self, seed: u64) -> u32 {
        let mut random = SplitMix64::new(seed);
        let mut poses = std::mem::take(&mut self.w.poses);
        let mut iteration = 0;
        while iteration < self.iterations_needed() {
            self.w.pools.draw(iteration, self.correspondences, &mut random, &mut poses);
            for pose in &poses {
                self.consider(pose, None);
            }
            iteration += 1;
        }
        self.w.poses = poses;
        iteration
    }

    fn iterations_needed(&self) -> u32 {
        let share = self.best.score.n_inliers as f64 / self.w.pools.n_usable() as f64;
        let all_inliers = share * share * share;
        let most = f64::from(self.settings.max_iterations);
        if all_inliers >= 1.0 - 1e-9 {
            return self.settings.max_iterations.min(1);
        }
        let none_drawn = libm::log(1.0 - all_inliers);
        if !(none_drawn < 0.0) {
            return self.settings.max_iterations;
        }
        let needed = libm::log(1.0 - self.settings.confidence) / none_drawn;
        if needed < most { needed as u32 + 1 } else { self.settings.max_iterations }
    }
}

/// Inliers, information and error of the refined pose; `None` where it is not good enough.
#[inline(always)]
fn judged(
    target_from_query: &Pose,
    guess: Option<usize>,
    n_iterations: u32,
    correspondences: &[Correspondence],
    settings: &PoseSettings,
    w: &mut PoseWorkspace,
) -> Option<PoseEstimate> {
    let motion = RelativeMotion::from(target_from_query);
    let (mut normal, mut inliers, mut n_both) = (NormalEquations::zero(), Vec::new(), 0);
    w.errors.clear();
    for (index, correspondence) in correspondences.iter().enumerate() {
        let Some(residual) = linearise(correspondence, &motion) else { continue };
        if residual.squared <= limit_sq(&residual, settings.inlier_sigmas) {
            normal.add(&residual, 1.0);
            inliers.push(index as u32);
            n_both += usize::from(residual.n_dimensions > 2.5);
            w.errors.push((residual.squared / residual.n_dimensions).sqrt());
        }
    }
    if inliers.len() < settings.min_inliers as usize || is_degenerate(&normal.information(), settings) {
        return None;
    }
    let middle = w.errors.len() / 2;
    let (_, median, _) = w.errors.select_nth_unstable_by(middle, f64::total_cmp);
    Some(PoseEstimate {
        target_from_query: *target_from_query,
        inliers,
        n_both,
        n_usable: w.pools.n_usable(),
        median_error: *median,
        information: normal.information(),
        guess,
        n_iterations,
    })
}

/// Whether the pose is uncertain beyond the settings in any direction. The trace of each block of
/// the covariance bounds its largest eigenvalue.
fn is_degenerate(information: &Matrix6, settings: &PoseSettings) -> bool {
    let Some(factor) = information.cholesky() else { return true };
    let covariance = factor.inverse();
    let variance = |first: usize| (first..first + 3).map(|k| covariance[(k, k)]).sum::<f64>();
    let limits = [settings.max_translation_sigma_m, settings.max_rotation_sigma_rad];
    !(variance(0) <= limits[0] * limits[0] && variance(3) <= limits[1] * limits[1])
}
