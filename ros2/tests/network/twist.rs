//! The twist of odometry and its covariance, as others read them, against the simulated room's own motion.

use crate::common::Network;
use crate::images::{base_from_camera, room_poses};
use crate::numbers;
use nalgebra::{Isometry3, Matrix6, Vector6};
use serde_json::Value;

/// One message of odometry.
struct Moving {
    stamp_nanos: i64,
    twist: Vector6<f64>,
    covariance: Matrix6<f64>,
}

impl Moving {
    fn read(line: &Value) -> Self {
        Self {
            stamp_nanos: line["stamp"].as_i64().unwrap(),
            twist: Vector6::from_row_slice(&numbers(&line["twist"])),
            covariance: Matrix6::from_row_slice(&numbers(&line["of_twist"])),
        }
    }

    /// Where the pose before was lost, or long ago, the velocity is stated as unknown.
    fn is_known(&self) -> bool {
        self.covariance.diagonal().iter().all(|variance| *variance < 1e5)
    }
}

/// Velocity from one pose to the next in the base's frame, metres and radians per second.
fn velocity(before: &Isometry3<f64>, now: &Isometry3<f64>, seconds: f64) -> Vector6<f64> {
    let moved = before.inverse() * now;
    let (linear, angular) = (moved.translation.vector / seconds, moved.rotation.scaled_axis() / seconds);
    Vector6::new(linear.x, linear.y, linear.z, angular.x, angular.y, angular.z)
}

#[test]
fn the_velocity_errs_as_its_covariance_states() {
    let Some(network) = Network::new() else { return };
    let (_, words, lines) = network.played(70, &[]);
    let (stamps, world_from_camera) = room_poses();
    // As camera.py plays them: to and fro, while time goes on.
    let period = stamps[1] - stamps[0];
    let base_at = |stamp_nanos: i64| {
        let at = ((stamp_nanos - stamps[0]) as f64 / period as f64).round() as usize % (2 * stamps.len() - 2);
        world_from_camera[at.min(2 * stamps.len() - 2 - at)] * base_from_camera().inverse()
    };
    let moving: Vec<Moving> =
        lines.iter().filter(|line| line["topic"] == "/tessera/odom").map(Moving::read).collect();
    let mut errors = Vec::new();
    for pair in moving.windows(2).filter(|pair| pair[1].is_known()) {
        let [before, now] = [&pair[0], &pair[1]];
        let seconds = (now.stamp_nanos - before.stamp_nanos) as f64 * 1e-9;
        let error = now.twist - velocity(&base_at(before.stamp_nanos), &base_at(now.stamp_nanos), seconds);
        let information = now.covariance.try_inverse().expect("a covariance of full rank");
        errors.push((error.transpose() * information * error).x / 6.0);
    }
    assert!(errors.len() >= 20, "{} velocities are known\n{words}", errors.len());
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    assert!((0.2..5.0).contains(&mean), "normalised squared error {mean}, expected about 1: {errors:?}");
}
