//! Direction of "up" in a camera, by which a map can be levelled.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

/// The direction against gravity.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct UpDirection {
    /// Unit vector in the camera's axes.
    pub in_camera: [f64; 3],
    /// Standard deviation of its tilt about each horizontal axis, radians.
    pub sigma_rad: f64,
}

impl UpDirection {
    /// Longest time over which forces are averaged for one direction, seconds: directions farther apart in time are of
    /// different forces.
    pub const LONGEST_S: f64 = 4.0;

    /// Of a vector that points up; `None` where it has no length, or a number is not finite.
    pub fn of(vector_in_camera: &Vector3<f64>, sigma_rad: f64) -> Option<Self> {
        let in_camera = (*vector_in_camera / vector_in_camera.norm()).into();
        Some(Self { in_camera, sigma_rad }).filter(Self::is_valid)
    }

    /// Whether all numbers are finite, the vector has unit length within 1e-6, and the deviation is positive.
    pub fn is_valid(&self) -> bool {
        let norm_sq: f64 = self.in_camera.iter().map(|v| v * v).sum();
        (norm_sq - 1.0).abs() < 2e-6 && self.sigma_rad.is_finite() && self.sigma_rad > 0.0
    }

    /// The rotation `world_from_camera` made level, so that the world's y axis points down: turned by the least
    /// angle, which keeps the camera's heading.
    pub fn levelled(&self, world_from_camera: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let (from, to) = (world_from_camera * Vector3::from(self.in_camera), -Vector3::y());
        // Upside down every horizontal axis would do: about the viewing direction.
        let half_turn = Quaternion::new(0.0, 0.0, 0.0, 1.0);
        let between = Quaternion::from_parts(1.0 + from.dot(&to), from.cross(&to));
        let level = UnitQuaternion::new_normalize(if between.norm() > 1e-6 { between } else { half_turn });
        UnitQuaternion::new_normalize(*(level * world_from_camera).quaternion())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::rotation_exp;

    #[test]
    fn a_levelled_world_has_y_down_and_the_camera_s_heading() {
        let cases = [[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.3, -0.8, -0.5]];
        for vector in cases.map(Vector3::from) {
            let up = UpDirection::of(&vector, 0.01).unwrap();
            for before in [UnitQuaternion::identity(), rotation_exp(&Vector3::new(0.3, -1.2, 0.5))] {
                let turned = up.levelled(&before) * Vector3::from(up.in_camera);
                assert!((turned + Vector3::y()).norm() < 1e-12, "{vector}: {turned}");
            }
        }
        // Looking down by 0.4 rad: the world looks straight ahead.
        let tilt = rotation_exp(&(Vector3::x() * -0.4));
        let up = UpDirection::of(&(tilt.inverse() * -Vector3::y()), 0.01).unwrap();
        assert!(up.levelled(&UnitQuaternion::identity()).angle_to(&tilt) < 1e-12);
    }

    #[test]
    fn nonsense_is_no_direction() {
        assert_eq!(UpDirection::of(&Vector3::zeros(), 0.01), None);
        assert_eq!(UpDirection::of(&Vector3::new(f64::NAN, 0.0, 1.0), 0.01), None);
        assert_eq!(UpDirection::of(&Vector3::x(), f64::INFINITY), None);
        assert_eq!(UpDirection::of(&Vector3::x(), 0.0), None);
        assert!(!UpDirection { in_camera: [0.5, 0.0, 0.0], sigma_rad: 0.1 }.is_valid());
    }
}
