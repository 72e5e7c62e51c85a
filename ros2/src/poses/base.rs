//! Frames of ROS, REP 103 and REP 105: `map -> odom -> base`, with x forward, y left and z up where
//! the camera has x right, y down and z forward.

use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};
use tessera_geometry::{Matrix6, Pose, UpDirection, adjoint};
use tessera_recording::FrameTree;
use tessera_recording::ros::Covariance;
use tessera_slam::WorldUp;

/// Standard deviation of a robot's tilt where nothing measures it, radians: it stands on a floor.
const STANDING_SIGMA_RAD: f64 = 0.05;

/// The base of the robot as seen from its camera.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Base {
    /// Maps points of the camera's optical frame to the base.
    base_from_camera: Pose,
    is_known: bool,
    /// Name of the base's frame.
    pub(crate) frame: String,
    /// Where it is from, for people.
    pub(crate) words: String,
}

impl Base {
    /// The base by `/tf_static`; where that does not say, at the camera, looking along its x.
    pub(crate) fn find(frames: &FrameTree, camera_frame: &str, base_frame: &str) -> Self {
        let known = match camera_frame == base_frame {
            true => Some(Pose::identity()),
            false => frames.between(camera_frame, base_frame),
        };
        let words = match &known {
            Some(_) => format!("{base_frame} is where /tf_static has it, seen from {camera_frame}"),
            None => format!(
                "/tf_static has no way from {camera_frame:?} to {base_frame}: the camera is taken as at {base_frame}, looking along its x"
            ),
        };
        let is_known = known.is_some();
        let base_from_camera = known.unwrap_or_else(looking_along_x);
        Self { base_from_camera, is_known, frame: base_frame.to_owned(), words }
    }

    /// Up in the camera where the robot stands level; `None` where the base is not known.
    pub(crate) fn up(&self) -> Option<UpDirection> {
        let up = self.base_from_camera.rotation.inverse() * Vector3::z();
        UpDirection::of(&up, STANDING_SIGMA_RAD).filter(|_| self.is_known)
    }

    /// From the world of the run to the frames `map` and `odom`, which begin where the base is at the start: at the
    /// base itself or, where the world is levelled, level and with its heading.
    pub(crate) fn map_from_world(&self, world_up: WorldUp) -> Pose {
        match (world_up, self.up()) {
            (WorldUp::Gravity, Some(up)) => {
                let camera_from_world = up.levelled(&UnitQuaternion::identity()).inverse();
                self.base_from_camera * Pose::from_parts(Translation3::identity(), camera_from_world)
            }
            _ => self.base_from_camera,
        }
    }

    /// The pose of the base in `map` or `odom`, from that of the camera in the world of the run.
    pub(crate) fn pose_in(&self, map_from_world: &Pose, world_from_camera: &Pose) -> Pose {
        map_from_world * world_from_camera * self.base_from_camera.inverse()
    }

    /// Covariance of the base's velocity over `seconds` between two poses, in its own frame, from those of
    /// the camera's poses about its own axes, whose errors are independent. `None` where either is unknown.
    pub(crate) fn velocity_covariance(
        &self,
        [of_before, of_now]: [&[[f64; 6]; 6]; 2],
        before_from_now: &Pose,
        seconds: f64,
    ) -> Option<Covariance> {
        let local = |of: &[[f64; 6]; 6]| Matrix6::from_fn(|row, column| of[row][column]);
        let (before, now) = (local(of_before), local(of_now));
        if [before, now].iter().any(|of| of.iter().all(|value| *value == 0.0)) {
            return None;
        }
        let to_base = adjoint(&self.base_from_camera);
        // before * exp(a), now * exp(b): between them exp(b - Ad(now_from_before) a) behind the motion.
        let back = adjoint(&before_from_now.inverse()) * to_base;
        let moved = back * before * back.transpose() + to_base * now * to_base.transpose();
        Some(std::array::from_fn(|row| {
            std::array::from_fn(|column| moved[(row, column)] / (seconds * seconds))
        }))
    }

    /// Covariance of the base's pose about the fixed axes of odom, from that of the camera's pose
    /// about its own axes. All zero is unknown, and answered with `None`.
    pub(crate) fn covariance(&self, of_camera: &[[f64; 6]; 6], odom_from_base: &Pose) -> Option<Covariance> {
        let local = Matrix6::from_fn(|row, column| of_camera[row][column]);
        if local.iter().all(|value| *value == 0.0) {
            return None;
        }
        let turn = *odom_from_base.rotation.to_rotation_matrix().matrix();
        let mut about_odom = Matrix6::zeros();
        about_odom.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
        about_odom.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
        let chain = about_odom * adjoint(&self.base_from_camera);
        let covariance = chain * local * chain.transpose();
        Some(std::array::from_fn(|row| std::array::from_fn(|column| covariance[(row, column)])))
    }
}

/// `base_from_camera` of an optical frame at the base: right is -y, down is -z, forward is x.
fn looking_along_x() -> Pose {
    let quaternion = Quaternion::new(0.5, -0.5, 0.5, -0.5);
    Pose::from_parts(Translation3::identity(), UnitQuaternion::new_normalize(quaternion))
}

/// A pose from translation and quaternion `x y z w`.
pub(crate) fn pose([x, y, z, qx, qy, qz, qw]: &[f64; 7]) -> Pose {
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(*qw, *qx, *qy, *qz));
    Pose::from_parts(Translation3::new(*x, *y, *z), rotation)
}

/// Velocity between two poses of the base in its own frame: metres and radians per second.
pub(crate) fn velocity(odom_from_before: &Pose, odom_from_now: &Pose, seconds: f64) -> ([f64; 3], [f64; 3]) {
    let before_from_now = odom_from_before.inverse() * odom_from_now;
    let moved = before_from_now.translation.vector / seconds;
    let turned = before_from_now.rotation.scaled_axis() / seconds;
    (moved.into(), turned.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Point3, Vector3};
    use tessera_geometry::{Twist, exp, log};
    use tessera_recording::ros::{Header, RosPose, Time, TransformStamped, Transforms, encode};

    fn tree(parent: &str, child: &str, transform: RosPose) -> FrameTree {
        let header = Header { stamp: Time::from_nanos(0), frame_id: parent.into() };
        let child_frame_id = child.into();
        let message = Transforms { transforms: vec![TransformStamped { header, child_frame_id, transform }] };
        let mut tree = FrameTree::default();
        tree.add(&encode(&message).unwrap()).unwrap();
        tree
    }

    fn of_base(base: &Base, world_from_camera: &Pose) -> Pose {
        base.pose_in(&base.map_from_world(WorldUp::Camera), world_from_camera)
    }

    #[test]
    fn a_levelled_world_is_a_level_map_whatever_the_camera_s_mount() {
        // The camera looks down by 0.3 rad, 0.2 m before the base and 1 m above it.
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.3);
        let optical = UnitQuaternion::new_normalize(Quaternion::new(0.5, -0.5, 0.5, -0.5));
        let q = tilt * optical;
        let transform = RosPose { position: [0.2, 0.0, 1.0], orientation_xyzw: [q.i, q.j, q.k, q.w] };
        let base = Base::find(&tree("base_link", "optical", transform), "optical", "base_link");
        let mount = base.up().unwrap();
        let map_from_world = base.map_from_world(WorldUp::Gravity);
        assert!((map_from_world.rotation * -Vector3::y() - Vector3::z()).norm() < 1e-12);
        // The robot stands level: the base is at the origin of the map, and has its axes.
        let level = mount.levelled(&UnitQuaternion::identity());
        let first = Pose::from_parts(Translation3::identity(), level);
        let map_from_base = base.pose_in(&map_from_world, &first);
        assert!(log(&map_from_base).to_vector().norm() < 1e-12);
        // It stands on a ramp of 0.1 rad: the map is level all the same, and the base is not.
        let ramp = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -0.1);
        let up = base.base_from_camera.rotation.inverse() * (ramp.inverse() * Vector3::z());
        let level = UpDirection::of(&up, 0.01).unwrap().levelled(&UnitQuaternion::identity());
        let first = Pose::from_parts(Translation3::identity(), level);
        let map_from_base = base.pose_in(&map_from_world, &first);
        assert!((map_from_base.rotation * ramp.inverse() * Vector3::z() - Vector3::z()).norm() < 1e-12);
        assert_eq!(Base::find(&FrameTree::default(), "optical", "base_link").up(), None);
    }

    #[test]
    fn without_tf_the_camera_looks_along_x() {
        let base = Base::find(&FrameTree::default(), "optical", "base_link");
        let at = |x, y, z| base.base_from_camera * Point3::new(x, y, z);
        assert!((at(0.0, 0.0, 1.0) - Point3::new(1.0, 0.0, 0.0)).norm() < 1e-12);
        assert!((at(1.0, 0.0, 0.0) - Point3::new(0.0, -1.0, 0.0)).norm() < 1e-12);
        assert!((at(0.0, 1.0, 0.0) - Point3::new(0.0, 0.0, -1.0)).norm() < 1e-12);
        // The camera moves forward by 2 m and 0.5 m down.
        let moved = of_base(&base, &Pose::translation(0.0, 0.5, 2.0));
        assert!((moved.translation.vector - Vector3::new(2.0, 0.0, -0.5)).norm() < 1e-12);
    }

    #[test]
    fn with_tf_the_base_is_where_it_says() {
        // The camera's optical frame is 0.2 m before the base and 1 m above it.
        let transform = RosPose { position: [0.2, 0.0, 1.0], orientation_xyzw: [-0.5, 0.5, -0.5, 0.5] };
        let base = Base::find(&tree("base_link", "optical", transform), "optical", "base_link");
        assert!(base.words.contains("where /tf_static has it"));
        // The camera turns left by a quarter turn: about its y by minus that.
        let turned =
            exp(&Twist { rho: Vector3::zeros(), phi: Vector3::new(0.0, -std::f64::consts::FRAC_PI_2, 0.0) });
        let odom_from_base = of_base(&base, &turned);
        // The base turns left about its z, and moves on a circle about the camera.
        assert!((odom_from_base.rotation.scaled_axis().z - std::f64::consts::FRAC_PI_2).abs() < 1e-12);
        assert!((odom_from_base.translation.vector - Vector3::new(0.2, -0.2, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn covariance_is_that_of_perturbed_poses() {
        let transform = RosPose { position: [0.2, -0.1, 1.0], orientation_xyzw: [-0.5, 0.5, -0.5, 0.5] };
        let base = Base::find(&tree("base_link", "optical", transform), "optical", "base_link");
        let camera = exp(&Twist { rho: Vector3::new(1.0, 2.0, 3.0), phi: Vector3::new(0.3, -0.7, 0.2) });
        let odom_from_base = of_base(&base, &camera);
        for axis in 0..6 {
            let mut local = [[0.0; 6]; 6];
            local[axis][axis] = 1.0;
            let covariance = base.covariance(&local, &odom_from_base).unwrap();
            let mut delta = [0.0; 6];
            delta[axis] = 1e-6;
            let twist = Twist {
                rho: Vector3::new(delta[0], delta[1], delta[2]),
                phi: Vector3::new(delta[3], delta[4], delta[5]),
            };
            let perturbed = of_base(&base, &(camera * exp(&twist)));
            let moved = (perturbed.translation.vector - odom_from_base.translation.vector) / 1e-6;
            let turned = (perturbed.rotation * odom_from_base.rotation.inverse()).scaled_axis() / 1e-6;
            let expected = [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z];
            for row in 0..6 {
                for column in 0..6 {
                    let difference = covariance[row][column] - expected[row] * expected[column];
                    assert!(difference.abs() < 1e-4, "axis {axis}: {row} {column}: {difference}");
                }
            }
        }
        assert_eq!(base.covariance(&[[0.0; 6]; 6], &odom_from_base), None);
    }

    #[test]
    fn covariance_of_velocity_is_that_of_perturbed_poses() {
        let transform = RosPose { position: [0.2, -0.1, 1.0], orientation_xyzw: [-0.5, 0.5, -0.5, 0.5] };
        let base = Base::find(&tree("base_link", "optical", transform), "optical", "base_link");
        let twist =
            |v: [f64; 6]| Twist { rho: Vector3::new(v[0], v[1], v[2]), phi: Vector3::new(v[3], v[4], v[5]) };
        let before = exp(&twist([1.0, 2.0, 3.0, 0.3, -0.7, 0.2]));
        let now = before * exp(&twist([0.01, -0.02, 0.03, 0.002, 0.03, -0.01]));
        let between = |before: &Pose, now: &Pose| of_base(&base, before).inverse() * of_base(&base, now);
        let (seconds, known) = (0.1, between(&before, &now));
        let tiny = 1e-30;
        let mut nearly_exact = [[0.0; 6]; 6];
        nearly_exact[0][0] = tiny;
        for axis in 0..6 {
            let mut local = [[0.0; 6]; 6];
            local[axis][axis] = 1.0;
            let mut delta = [0.0; 6];
            delta[axis] = 1e-6;
            let moved = exp(&twist(delta));
            for (of, perturbed) in [
                ([&local, &nearly_exact], between(&(before * moved), &now)),
                ([&nearly_exact, &local], between(&before, &(now * moved))),
            ] {
                let covariance = base.velocity_covariance(of, &known, seconds).unwrap();
                let difference = log(&(known.inverse() * perturbed));
                let expected = [difference.rho, difference.phi].map(|v| v / (1e-6 * seconds));
                let expected = |row: usize| expected[row / 3][row % 3];
                for (row, values) in covariance.iter().enumerate() {
                    for (column, value) in values.iter().enumerate() {
                        let wrong = value - expected(row) * expected(column);
                        assert!(wrong.abs() < 1e-2, "axis {axis}: {row} {column}: {wrong}");
                    }
                }
            }
        }
        let unknown = [[0.0; 6]; 6];
        assert_eq!(base.velocity_covariance([&unknown, &nearly_exact], &known, seconds), None);
    }

    #[test]
    fn velocity_is_in_the_base_s_own_frame() {
        let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let before = Pose::from_parts(Translation3::new(1.0, 0.0, 0.0), quarter);
        let now = Pose::from_parts(Translation3::new(1.0, 0.5, 0.0), quarter);
        let (linear, angular) = velocity(&before, &now, 0.5);
        assert!((Vector3::from(linear) - Vector3::new(1.0, 0.0, 0.0)).norm() < 1e-12);
        assert!(Vector3::from(angular).norm() < 1e-12);
    }
}
