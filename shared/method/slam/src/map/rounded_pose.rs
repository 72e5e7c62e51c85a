//! Relative poses in whole steps, so that what is computed at one is a function of few numbers.

use serde::{Deserialize, Serialize};
use tessera_geometry::{Pose, Twist, Vector6, exp, log};

/// A relative pose whose tangent vector is in steps of a `PER_UNIT`-th of a metre and of a radian.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RoundedPose<const PER_UNIT: u32>([i32; 6]);

impl<const PER_UNIT: u32> RoundedPose<PER_UNIT> {
    /// The pose in whole steps that is nearest.
    pub fn of(target_from_query: &Pose) -> Self {
        let tangent = log(target_from_query).to_vector() * f64::from(PER_UNIT);
        Self(std::array::from_fn(|k| tangent[k].round() as i32))
    }

    /// The pose itself.
    pub fn pose(&self) -> Pose {
        exp(&Twist::from_vector(&(Vector6::from(self.0.map(f64::from)) / f64::from(PER_UNIT))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::translation_rotation_norms;

    #[test]
    fn a_rounded_pose_is_near_and_the_same_for_poses_nearby() {
        let at = |x: f64| exp(&Twist::from_vector(&Vector6::new(x, -0.4, 0.9, 0.3, -0.2, 0.1)));
        let guess = RoundedPose::<32>::of(&at(0.195));
        assert_eq!(guess, RoundedPose::of(&at(0.199)));
        assert_ne!(guess, RoundedPose::of(&at(0.240)));
        assert_eq!(guess, RoundedPose::of(&guess.pose()));
        let (apart_m, apart_rad) = translation_rotation_norms(&(guess.pose().inverse() * at(0.195)));
        assert!(apart_m < 2.0 / 32.0 && apart_rad < 1.0 / 32.0, "{apart_m} m, {apart_rad} rad");
    }
}
