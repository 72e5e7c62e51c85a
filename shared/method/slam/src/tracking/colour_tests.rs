//! Features of points in front of a plane, seen by a moving colour camera that lags and has another
//! focal length.

use crate::estimation::colour_model::{ColourModel, ColourState};
use crate::estimation::noise_scales::{NoiseScales, NoiseState};
use crate::map::context::Context;
use crate::map::test_wall::context;
use crate::pairs::colour_coupling::coupling;
use crate::pairs::colour_evidence::own_nats;
use crate::pairs::lift::lift;
use crate::pairs::noise_evidence::{PairEvidence, evidence};
use crate::pairs::residuals;
use crate::pairs::weighted_pair::FeaturePair;
use crate::pairs::weighted_pair::WeightedPair;
use crate::tracking::observed::Observed;
use nalgebra::{Matrix3, Vector3};
use std::sync::Arc;
use tessera_features::{Correspondence, Feature, Observation, PointEstimate};
use tessera_geometry::{Pose, Twist, compose_normalised, exp};
use tessera_graph::{BlockSums, HalfSums, PairBlock};
use tessera_numerics::SplitMix64;
use tessera_surface::{SurfaceView, Vertex};

const DEPTH_M: f64 = 2.0;

fn uniform(random: &mut SplitMix64) -> f64 {
    random.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0
}

/// The plane `z = DEPTH_M` of the world as a camera at a pose sees it.
fn plane(context: &Context, world_from_camera: &Pose) -> Vec<Vertex> {
    let (grid, camera_from_world) = (context.grid, world_from_camera.inverse());
    let normal = camera_from_world.rotation * Vector3::new(0.0, 0.0, -1.0);
    let on_plane = camera_from_world * nalgebra::Point3::new(0.0, 0.0, DEPTH_M);
    let vertex = |cell: usize| {
        let [row, column] =
            [cell / grid.width, cell % grid.width].map(|k| (k * grid.step) as f64 + context.offset_px);
        let ray = context.camera.ray(row, column);
        let point = ray * (normal.dot(&on_plane.coords) / normal.dot(&ray));
        Vertex {
            position: [point.x, point.y, point.z].map(|v| v as f32),
            normal: [normal.x, normal.y, normal.z].map(|v| v as f32),
            reserved: 0,
            flags_rgb: Vertex::pack(Vertex::VALID, 0, [0; 3]),
        }
    };
    (0..grid.len()).map(vertex).collect()
}

/// Points of the plane around the optical axis.
fn points(n: usize) -> Vec<Vector3<f64>> {
    let mut random = SplitMix64::for_frame(3, 1);
    (0..n).map(|_| Vector3::new(0.8 * uniform(&mut random), 0.6 * uniform(&mut random), DEPTH_M)).collect()
}

/// Where the colour camera of a frame sees points of the world.
fn features(context: &Context, truth: &ColourModel, pose: &Pose, velocity: &Twist) -> Vec<Feature> {
    // The camera at exposure: `world_from_camera * exp(velocity lag)`.
    let camera_from_world = (pose * exp(&velocity.scaled(truth.lag_s))).inverse();
    let seen = |p: &Vector3<f64>| {
        let point = camera_from_world * nalgebra::Point3::from(*p);
        let pixel = truth.pixel(&context.camera, &point.coords).unwrap();
        Feature { pixel: pixel.map(|v| v as f32), sigma_px: 1.0, ..Feature::default() }
    };
    points(200).iter().map(seen).collect()
}

/// Frames about the origin, each with its own motion.
fn frame(k: u64) -> (Pose, Twist) {
    let mut random = SplitMix64::for_frame(11, k);
    let mut vector =
        |size: f64| Vector3::new(uniform(&mut random), uniform(&mut random), uniform(&mut random)) * size;
    let pose = exp(&Twist { rho: vector(0.2), phi: vector(0.1) });
    (pose, Twist { rho: vector(0.3), phi: vector(0.8) })
}

fn observed(context: &Context, truth: &ColourModel, k: u64) -> Vec<Observation> {
    let (pose, velocity) = frame(k);
    let vertices = plane(context, &pose);
    let surface = SurfaceView { grid: context.grid, vertices: &vertices };
    lift(context, &features(context, truth, &pose, &velocity), &surface, &velocity)
}

/// Pairs of frames with each other: what an estimate finds, applied again and again.
fn estimate(truth: &ColourModel, stated: ColourModel) -> ColourState {
    let mut context = context();
    let mut state = ColourState::stated(stated);
    assert_eq!(state.model, stated, "applied from the first frame on");
    for k in 0..120 {
        context = context.with_colour(&state, &NoiseState::default());
        let sides = [k, k + 1].map(|k| observed(&context, truth, k));
        let [(query, query_velocity), (target, target_velocity)] = [k, k + 1].map(frame);
        let target_from_query = target.inverse() * query;
        let sides = sides[0].iter().zip(&sides[1]);
        let inliers: Vec<Correspondence> =
            sides.map(|(query, target)| Correspondence { query: *query, target: *target }).collect();
        // Surfaces that know the relative pose to a millimetre.
        let mut lower = BlockSums { n: 8, ..BlockSums::default() };
        for p in points(8) {
            lower.add(&p, &Vector3::zeros(), &(Matrix3::identity() * 1e6));
        }
        let surfaces = HalfSums { lower, ..HalfSums::default() };
        let found = Arc::new(FeaturePair::new(target_from_query, inliers));
        let of = |sums: &BlockSums| {
            let (h, g, _) = PairBlock::new(&target_from_query, sums).linearise(&target_from_query);
            (h, g)
        };
        let velocities = [query_velocity, target_velocity];
        let slope = coupling(&found, [&query_velocity, &target_velocity], &context.colour);
        let nats = own_nats(&of(&lower), &of(&found.sums), &slope, &ColourState::prior_covariance());
        let mut sums = Observed::default();
        sums.add(&context.camera, &found.inliers, &target_from_query, nats);
        state.apply_audit(&sums.record().unwrap());
        let features = WeightedPair::new(found, 1.0, &target_from_query);
        let pair = PairEvidence {
            target_from_query,
            velocities,
            surfaces: (&target_from_query, &surfaces),
            features: Some(&features),
        };
        let scales = NoiseScales { surfaces: 1.0, features: 1.0 };
        let evidence = evidence(std::iter::once(pair), 1.0, &scales, Some(&context.colour)).unwrap();
        state.apply_pose(&evidence.colour.unwrap());
    }
    state
}

#[test]
fn a_feature_gets_the_depth_under_it_whatever_lag_and_focal_length() {
    let mut context = context();
    for truth in [
        ColourModel::default(),
        ColourModel { lag_s: 0.02, focal_ratio: 1.0, readout_s: 0.0 },
        ColourModel { lag_s: -0.01, focal_ratio: 0.9, readout_s: 0.0 },
    ] {
        context.colour = truth;
        for k in 0..5 {
            let camera_from_world = frame(k).0.inverse();
            let observations = observed(&context, &truth, k);
            let with_depth = observations.iter().filter(|o| o.point.is_some()).count();
            assert!(with_depth > 120, "{with_depth} of {}", observations.len());
            for (o, p) in observations.iter().zip(points(200)) {
                let Some(found) = o.point else { continue };
                let expected = camera_from_world * nalgebra::Point3::from(p);
                let error = (found.position_m - expected.coords).norm();
                assert!(error < 1e-3, "{truth:?}: {error}");
                assert!(found.covariance_m2.cholesky().is_some());
            }
        }
    }
}

#[test]
fn a_planted_lag_and_a_planted_focal_length_are_found_and_none_where_there_is_none() {
    for truth in [
        ColourModel::default(),
        ColourModel { lag_s: 0.02, focal_ratio: 1.0, readout_s: 0.0 },
        ColourModel { lag_s: 0.0, focal_ratio: 0.9, readout_s: 0.0 },
        ColourModel { lag_s: -0.015, focal_ratio: 1.04, readout_s: 0.0 },
    ] {
        let found = estimate(&truth, ColourModel::default());
        assert!((found.model.lag_s - truth.lag_s).abs() < 1e-3, "{truth:?}: {found:?}");
        assert!((found.model.focal_ratio - truth.focal_ratio).abs() < 3e-3, "{truth:?}: {found:?}");
        assert!(found.own_nats > 5.0, "{truth:?}: {found:?}");
        assert!(found.residual_px < 1.0, "{truth:?}: {found:?}");
    }
}

#[test]
fn what_the_camera_file_states_is_the_start_and_not_the_last_word() {
    let truth = ColourModel { lag_s: 0.02, focal_ratio: 0.95, readout_s: 0.0 };
    for stated in [truth, ColourModel { lag_s: -0.01, focal_ratio: 1.03, readout_s: 0.0 }] {
        let found = estimate(&truth, stated).model;
        assert!((found.lag_s - truth.lag_s).abs() < 2e-3, "{stated:?}: {found:?}");
        assert!((found.focal_ratio - truth.focal_ratio).abs() < 5e-3, "{stated:?}: {found:?}");
    }
}

#[test]
fn the_sums_have_the_slope_of_the_squared_errors() {
    let at = exp(&Twist { rho: Vector3::new(0.05, -0.02, 0.03), phi: Vector3::new(0.02, 0.05, -0.03) });
    let mut random = SplitMix64::for_frame(5, 2);
    let correspondences: Vec<Correspondence> = (0..60)
        .map(|k| {
            let mut noise = || Vector3::new(uniform(&mut random), uniform(&mut random), uniform(&mut random));
            let a = noise() + Vector3::new(0.0, 0.0, 2.5);
            let b = at * nalgebra::Point3::from(a + noise() * 0.003);
            let side = |p: Vector3<f64>, has_depth: bool| {
                let ray = [p.x / p.z, p.y / p.z];
                let point = PointEstimate::on_ray(ray, 0.002, p.z, 0.01);
                Observation { ray, ray_sigma: 0.002, point: has_depth.then_some(point) }
            };
            Correspondence { query: side(a, k % 3 != 1), target: side(b.coords, k % 3 != 2) }
        })
        .collect();
    let sums = residuals::sums(&correspondences, &at, 1.0);
    assert_eq!(sums.n, 60);
    let block = PairBlock::new(&at, &sums);
    let (h, g, _) = block.linearise(&at);
    assert!((h - h.transpose()).norm() < 1e-9 * h.norm() && h.cholesky().is_some());
    for k in 0..6 {
        let cost = |step: f64| {
            let mut d = tessera_geometry::Vector6::zeros();
            d[k] = step;
            block.cost(&compose_normalised(&at, &Twist::from_vector(&d)))
        };
        let slope = (cost(1e-6) - cost(-1e-6)) / 2e-6;
        assert!((slope - 2.0 * g[k]).abs() < 1e-5 * h[(k, k)].max(1.0), "direction {k}");
    }
    // About another transform it is the same cost.
    let there = at * Pose::translation(0.01, -0.02, 0.005);
    let moved = PairBlock::new(&there, &sums.about(&at, &there));
    assert!((moved.cost(&at) - block.cost(&at)).abs() < 1e-9 * block.cost(&there));
    assert!((moved.linearise(&at).1 - g).norm() < 1e-9 * h.norm());
}

#[test]
fn a_bearing_says_nothing_along_its_ray() {
    let p = Vector3::new(0.3, -0.2, 2.0);
    let ray = [p.x / p.z, p.y / p.z];
    let point = PointEstimate { position_m: p, covariance_m2: Matrix3::identity() * 1e-6, is_inner: true };
    let with = Observation { ray, ray_sigma: 0.002, point: Some(point) };
    let c = Correspondence { query: with, target: Observation { point: None, ..with } };
    let along = Pose::translation(0.1 * p.x, 0.1 * p.y, 0.1 * p.z);
    assert!(residuals::squared_error(&c, &along) < 1e-12);
    let across = Pose::translation(0.02, 0.0, 0.0);
    assert!(
        (residuals::squared_error(&c, &across).sqrt() - 0.02 / (2.0_f64.sqrt() * 0.002 * 2.0)).abs() < 0.2
    );
}
