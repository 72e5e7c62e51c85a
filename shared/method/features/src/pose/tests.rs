//! The estimate over simulated views of random points.

use super::*;
use crate::settings::PoseSettings;
use nalgebra::Vector3;
use tessera_geometry::{Pose, Twist, exp, log};
use tessera_numerics::SplitMix64;

const FOCAL_PX: f64 = 525.0;

/// Contents of a simulated view.
#[derive(Clone, Copy)]
struct View {
    n: usize,
    outliers: f64,
    /// Share of observations of each side without depth.
    missing: [f64; 2],
    seed: u64,
}

impl Default for View {
    fn default() -> Self {
        Self { n: 200, outliers: 0.6, missing: [0.0; 2], seed: 1 }
    }
}

fn truth() -> Pose {
    exp(&Twist { rho: Vector3::new(0.2, -0.1, 0.15), phi: Vector3::new(0.1, -0.25, 0.05) })
}

fn normal(random: &mut SplitMix64) -> f64 {
    (0..12).map(|_| random.unit()).sum::<f64>() - 6.0
}

fn observe(p: &Vector3<f64>, has_depth: bool, random: &mut SplitMix64) -> Observation {
    let sigma = 1.0 / FOCAL_PX;
    let ray = [p.x / p.z + sigma * normal(random), p.y / p.z + sigma * normal(random)];
    let depth_sigma = 0.002 * p.z * p.z;
    let depth = p.z + depth_sigma * normal(random);
    let point = has_depth.then(|| PointEstimate::on_ray(ray, sigma, depth, depth_sigma));
    Observation { ray, ray_sigma: sigma, point }
}

fn view(v: View) -> (Vec<Correspondence>, Vec<bool>) {
    let mut random = SplitMix64::new(v.seed);
    let draw = |random: &mut SplitMix64| {
        Vector3::new(random.unit() * 2.0 - 1.0, random.unit() * 1.6 - 0.8, 1.0 + 2.5 * random.unit())
    };
    let make = |_| {
        let p = draw(&mut random);
        let is_inlier = random.unit() >= v.outliers;
        let seen = if is_inlier { truth() * nalgebra::Point3::from(p) } else { draw(&mut random).into() };
        let has = v.missing.map(|share| random.unit() >= share);
        let query = observe(&p, has[0], &mut random);
        (Correspondence { query, target: observe(&seen.coords, has[1], &mut random) }, is_inlier)
    };
    (0..v.n).map(make).unzip()
}

fn estimate(c: &[Correspondence], guesses: &[Pose]) -> Option<PoseEstimate> {
    estimate_pose(c, guesses, 7, &PoseSettings::default(), &mut PoseWorkspace::new(pulp::Arch::new()))
}

/// The truth is found, with honest information and the right inliers.
fn check(v: View) -> PoseEstimate {
    let (correspondences, is_inlier) = view(v);
    let found = estimate(&correspondences, &[]).expect("a pose is found");
    let error = log(&(found.target_from_query.inverse() * truth())).to_vector();
    let normalised = error.dot(&(found.information * error)) / 6.0;
    assert!(normalised < 4.0, "error {error:?} is {normalised} of its variance");
    assert!(error.norm() < 0.02, "{error:?}");
    let n_wrong = found.inliers.iter().filter(|&&i| !is_inlier[i as usize]).count();
    assert!(n_wrong * 20 <= found.inliers.len(), "{n_wrong} of {}", found.inliers.len());
    let usable = |c: &Correspondence| c.query.point.is_some() || c.target.point.is_some();
    let n_right = (0..v.n).filter(|&i| is_inlier[i] && usable(&correspondences[i])).count();
    assert!(found.inliers.len() * 10 >= n_right * 9, "{} of {n_right}", found.inliers.len());
    assert!((0.4..1.3).contains(&found.median_error), "{}", found.median_error);
    found
}

#[test]
fn a_pose_is_recovered_among_outliers_with_and_without_depth() {
    for seed in 1..20 {
        for missing in [[0.0, 0.0], [0.5, 0.5], [1.0, 0.0], [0.0, 1.0], [0.3, 0.95]] {
            check(View { missing, seed, ..View::default() });
        }
    }
}

#[test]
fn clean_matches_end_early() {
    let found = check(View { outliers: 0.0, ..View::default() });
    assert!(found.n_iterations < 10 && found.n_both == found.inliers.len(), "{}", found.n_iterations);
}

#[test]
fn a_good_guess_is_used_and_a_bad_one_does_no_harm() {
    let (correspondences, _) = view(View { outliers: 0.8, ..View::default() });
    let bad = exp(&Twist { rho: Vector3::new(1.0, 0.0, 0.0), phi: Vector3::new(0.0, 0.5, 0.0) });
    let found = estimate(&correspondences, &[bad, truth()]).unwrap();
    assert_eq!(found.guess, Some(1));
    let (correspondences, _) = view(View::default());
    let found = estimate(&correspondences, &[bad]).unwrap();
    assert_eq!(found.guess, None);
}

#[test]
fn too_few_or_degenerate_points_give_no_pose() {
    assert!(estimate(&[], &[truth()]).is_none());
    let (correspondences, _) = view(View { n: 2, outliers: 0.0, ..View::default() });
    let lenient = PoseSettings { min_inliers: 4, ..PoseSettings::default() };
    let mut workspace = PoseWorkspace::new(pulp::Arch::new());
    assert!(estimate_pose(&correspondences, &[truth()], 1, &lenient, &mut workspace).is_none());
    let (mut correspondences, _) = view(View { outliers: 0.0, ..View::default() });
    let mut random = SplitMix64::new(4);
    for (i, c) in correspondences.iter_mut().enumerate() {
        let p = Vector3::new(0.3, -0.2, 2.0) + Vector3::new(0.5, 0.4, 0.3) * (i as f64 / 100.0 - 1.0);
        let seen = truth() * nalgebra::Point3::from(p);
        *c = Correspondence {
            query: observe(&p, true, &mut random),
            target: observe(&seen.coords, true, &mut random),
        };
    }
    assert!(estimate(&correspondences, &[]).is_none(), "points on a line");
    assert!(estimate(&correspondences, &[truth()]).is_none(), "points on a line, with a guess");
    let one = correspondences[0];
    assert!(estimate(&vec![one; 50], &[truth()]).is_none(), "one point many times");
    let (mut no_depth, _) = view(View { missing: [1.0; 2], outliers: 0.0, ..View::default() });
    assert!(estimate(&no_depth, &[truth()]).is_none(), "bearings alone");
    no_depth.iter_mut().for_each(|c| c.query.ray = [f64::NAN; 2]);
    assert!(estimate(&no_depth, &[]).is_none());
}

#[test]
fn nonsense_agrees_on_nothing() {
    for seed in 1..10 {
        let (correspondences, _) = view(View { n: 100, outliers: 1.0, seed, ..View::default() });
        if let Some(found) = estimate(&correspondences, &[]) {
            assert!(found.inliers.len() < 15, "{}", found.inliers.len());
        }
    }
}

#[test]
fn the_same_bits_for_every_instruction_set_and_run() {
    let (correspondences, _) = view(View { missing: [0.3, 0.4], ..View::default() });
    let settings = PoseSettings::default();
    let run = |arch| estimate_pose(&correspondences, &[], 3, &settings, &mut PoseWorkspace::new(arch));
    let first = run(pulp::Arch::new());
    assert!(first.is_some());
    assert_eq!(first, run(pulp::Arch::new()));
    assert_eq!(first, run(pulp::Arch::Scalar));
}
