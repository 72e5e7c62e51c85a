//! Chains of poses whose roll and pitch drift, with up measured at each.

use super::*;
use crate::graph::tests::pair;
use crate::lean::weigh_up;
use crate::{Graph, Pair, Prior, Solver};
use tessera_geometry::{Matrix6, Twist, Vector6, exp, rotation_exp, rotation_log};
use tessera_numerics::SplitMix64;

const N: usize = 120;
/// Deviation of a measurement, and of the constant error, radians.
const NOISE: f64 = 0.01;
/// Deviation of a pair's turn, radians.
const TURN_NOISE: f64 = 0.002;

/// Up of the world, and a camera that goes round in it and nods; the world has the axes of the first camera.
fn truth() -> (Vector3<f64>, Vec<Pose>) {
    let level_from_camera = |k: usize| {
        let (turn, k) = (0.08 * k as f64, k as f64);
        let nod = rotation_exp(&Vector3::new(0.2 * (0.31 * k).sin(), 0.0, 0.1 * (0.23 * k).cos()));
        let position = Vector3::new(3.0 * turn.sin(), 0.0, -3.0 * turn.cos());
        Pose::from_parts(position.into(), rotation_exp(&(Vector3::y() * turn)) * nod)
    };
    let world_from_level = level_from_camera(0).inverse();
    let poses = (0..N).map(|k| world_from_level * level_from_camera(k)).collect();
    (world_from_level.rotation * -Vector3::y(), poses)
}

/// How pairs and measurements err.
struct Planted {
    /// Turn of the world by each pair, radians about its x axis.
    drift: f64,
    /// Constant error in the camera's axes.
    bias: Vector3<f64>,
    /// Factor of the information that the pairs state.
    overstated: f64,
    /// Error of a measurement in the camera's axes beside noise.
    fault: fn(usize) -> Vector3<f64>,
}

/// Errors of the poses without and with up: largest tilt and turn about up, radians, and position, metres.
fn errors(planted: &Planted) -> [[f64; 3]; 2] {
    let (up_in_world, truth) = truth();
    let mut random = SplitMix64::new(5);
    let mut noise = || {
        let mut gaussian = || (0..12).map(|_| random.unit()).sum::<f64>() - 6.0;
        Vector3::new(gaussian(), gaussian(), gaussian()) * NOISE
    };
    let turn = exp(&Twist { phi: Vector3::x() * planted.drift, ..Twist::default() });
    let mut poses = vec![truth[0]];
    let mut pairs = Vec::new();
    for k in 1..N {
        // The pose before turns the world beyond it.
        let about = Pose::from_parts(Vector3::zeros().into(), truth[k - 1].rotation);
        let between = about.inverse() * turn * about * (truth[k - 1].inverse() * truth[k]);
        poses.push(poses[k - 1] * between);
        // The cross of a pair has information 4 about each axis.
        let weight = 0.25 * planted.overstated / (TURN_NOISE * TURN_NOISE);
        pairs.push(Pair { weight, ..pair(k, k - 1, &between) });
    }
    let mut measured = Vec::new();
    for (vertex, pose) in truth.iter().enumerate() {
        let force = pose.rotation.inverse() * up_in_world + planted.bias + noise() + (planted.fault)(vertex);
        measured.push(Up { vertex, instrument: N, in_camera: force.normalize(), sigma_rad: NOISE });
    }
    [Vec::new(), measured].map(|measured| {
        let mut graph = Graph { poses: poses.clone(), pairs: pairs.clone(), ..Graph::default() };
        graph.is_fixed = (0..N).map(|k| k == 0).collect();
        if !measured.is_empty() {
            let sum: Vector3<f64> = measured.iter().map(|up| poses[up.vertex].rotation * up.in_camera).sum();
            let vertical = nalgebra::UnitQuaternion::rotation_between(&-Vector3::y(), &sum).unwrap();
            let predicted = Pose::from_parts(Vector3::zeros().into(), vertical);
            let known = Vector6::new(1.0, 1.0, 1.0, 0.0, 1.0, 0.0) / (NOISE * NOISE);
            let information = Matrix6::from_diagonal(&known);
            graph.poses.push(predicted);
            graph.is_fixed.push(false);
            graph.priors.push(Prior { vertex: N, predicted, information });
            graph.ups = Ups { measured, freedom: 4.0, unit: 1.0, weight: 1.0, prior_freedom: 20.0 };
        }
        let mut solver = Solver::default();
        graph.optimise_again(30, &mut solver, &mut || ()).unwrap();
        weigh_up(&mut graph, 30, &mut solver, &mut || ()).unwrap();
        assert_eq!(graph.poses[0], truth[0]);
        let mut worst = [0.0f64; 3];
        for (found, truth) in graph.poses.iter().zip(&truth) {
            let error = found.rotation * truth.rotation.inverse();
            let tilt = (error * up_in_world).angle(&up_in_world);
            let heading = rotation_log(&error).dot(&up_in_world).abs();
            let apart = (found.translation.vector - truth.translation.vector).norm();
            worst = [worst[0].max(tilt), worst[1].max(heading), worst[2].max(apart)];
        }
        worst
    })
}

impl Default for Planted {
    fn default() -> Self {
        Self { drift: 0.0, bias: Vector3::zeros(), overstated: 1.0, fault: |_| Vector3::zeros() }
    }
}

#[test]
fn drift_in_roll_and_pitch_is_held_to_the_noise() {
    let bias = Vector3::new(0.01, 0.0, -0.008);
    for overstated in [1.0, 30.0] {
        let [without, with] = errors(&Planted { drift: 0.002, bias, overstated, ..Planted::default() });
        assert!(without[0] > 0.15, "{without:?}");
        assert!(with[0] < 3.0 * NOISE && with[1] < without[1] + 0.1 * NOISE, "{overstated}: {with:?}");
        assert!(with[2] < 0.5 * without[2], "{overstated}: {with:?}");
    }
}

#[test]
fn without_drift_noise_bends_nothing() {
    for overstated in [1.0, 30.0] {
        let [without, with] = errors(&Planted { overstated, ..Planted::default() });
        assert!(without[0] < 1e-6 && with[0] < 1.5 * NOISE && with[1] < 0.01 * NOISE, "{with:?}");
    }
}

#[test]
fn accelerations_of_some_poses_do_not_bend_a_map() {
    let fault = |k: usize| if k % 12 < 3 { Vector3::new(0.5, 0.1, 0.4) } else { Vector3::zeros() };
    for (drift, overstated) in [(0.0, 1.0), (0.0, 30.0), (0.002, 1.0)] {
        let [_, with] = errors(&Planted { drift, overstated, fault, ..Planted::default() });
        assert!(with[0] < 4.0 * NOISE, "{with:?}");
    }
}

#[test]
fn derivatives_are_those_of_the_residual() {
    let poses = [
        exp(&Twist { rho: Vector3::new(1.0, -2.0, 0.3), phi: Vector3::new(0.4, -0.9, 0.2) }),
        exp(&Twist { rho: Vector3::new(0.02, 0.01, -0.03), phi: Vector3::new(-1.0, 0.3, 0.6) }),
    ];
    let in_camera = Vector3::new(0.2, -0.9, 0.1).normalize();
    let up = Up { vertex: 0, instrument: 1, in_camera, sigma_rad: 1.0 };
    let (e, of_camera, of_instrument) = up.linearise(&poses);
    for (vertex, jacobian) in [of_camera, of_instrument].iter().enumerate() {
        for k in 0..6 {
            let mut moved = poses;
            let mut step = Vector6::zeros();
            step[k] = 1e-6;
            moved[vertex] = poses[vertex] * exp(&Twist::from_vector(&step));
            let change = (up.residual(&moved).0 - e) / 1e-6;
            assert!((change - jacobian.column(k)).norm() < 1e-5, "{vertex} {k}: {change}");
        }
    }
}
