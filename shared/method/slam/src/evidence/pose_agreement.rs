//! Whether two estimates of a pose agree: the squared Mahalanobis distance under their relative covariance,
//! against the chi-square of its dimension (Bar-Shalom, Li and Kirubarajan 2001, chapter 5).

use crate::map::state::KeyframeState;
use crate::settings::WindowSettings;
use nalgebra::SymmetricEigen;
use std::f64::consts::PI;
use tessera_geometry::{
    Matrix6, Pose, PoseBits, Vector6, adjoint, from_upper_triangle, log, translation_rotation_norms,
};

pub(crate) use crate::estimation::CHI_SQUARE_6;

/// Numbers of the upper triangle of a 6x6 matrix.
const N_UPPER: usize = 21;

/// Distance of two poses beyond which they are two places, metres, half a radian as a metre: drift that is smaller
/// brings no other room.
pub(crate) const FAR_M: f64 = 1.0;
const METRES_PER_RADIAN: f64 = 2.0;
/// Volume of the poses that are not far, metres and radians, each cubed: a ball of either.
pub(crate) const FAR_VOLUME: f64 = {
    let ball = 4.0 / 3.0 * PI;
    let (far_m, far_rad) = (FAR_M, FAR_M / METRES_PER_RADIAN);
    ball * far_m * far_m * far_m * ball * far_rad * far_rad * far_rad
};

/// How far apart two poses are, metres, half a radian as a metre.
pub(crate) fn apart_m(a: &Pose, b: &Pose) -> f64 {
    let (metres, radians) = translation_rotation_norms(&(a.inverse() * b));
    metres.max(METRES_PER_RADIAN * radians)
}

/// A pose with its covariance in the tangent `d` of `pose * exp(d)`, translation first, metres and radians.
#[derive(Clone, Copy, Debug)]
pub(crate) struct UncertainPose {
    pub(crate) pose: Pose,
    pub(crate) covariance: Matrix6,
}

impl UncertainPose {
    /// From a record; `None` where that has no covariance.
    pub(crate) fn read(pose: &PoseBits, upper_triangle: &[f64]) -> Option<Self> {
        let is_known = upper_triangle.len() == N_UPPER;
        is_known.then(|| Self { pose: Pose::from(pose), covariance: from_upper_triangle(upper_triangle) })
    }

    /// The pose of `to` in the frame of `from`, both poses of one track: what `to` inherited of the uncertainty of
    /// `from` cancels, so that the covariance is their difference, without the directions in which it is negative.
    pub(crate) fn along_track(from: &Self, to: &Self) -> Self {
        let pose = from.pose.inverse() * to.pose;
        let carry = adjoint(&pose.inverse());
        let since = to.covariance - carry * from.covariance * carry.transpose();
        Self { pose, covariance: positive(&since) }
    }

    /// The same where neither inherited from the other: the covariances add.
    pub(crate) fn apart(from: &Self, to: &Self) -> Self {
        let pose = from.pose.inverse() * to.pose;
        let carry = adjoint(&pose.inverse());
        Self { pose, covariance: to.covariance + carry * from.covariance * carry.transpose() }
    }

    /// The covariance in the tangent of a pose that stands at `pose_from_other`.
    pub(crate) fn carried_to(&self, pose_from_other: &Pose) -> Matrix6 {
        let carry = adjoint(&pose_from_other.inverse());
        carry * self.covariance * carry.transpose()
    }

    /// Squared Mahalanobis distance from another estimate of the same pose, independent of this one.
    pub(crate) fn squared_distance(&self, other: &Self) -> f64 {
        let (difference, sum) = self.difference(other);
        squared_norm(&difference, &sum)
    }

    /// The difference from another estimate of the same pose, independent of this one, with its covariance.
    fn difference(&self, other: &Self) -> (Vector6, Matrix6) {
        let difference = self.pose.inverse() * other.pose;
        let carry = adjoint(&difference);
        let sum = self.covariance + carry * other.covariance * carry.transpose();
        (log(&difference).to_vector(), sum)
    }

    /// Log-likelihood ratio of one pose for both estimates against another one anywhere in a region of so much
    /// volume (metres and radians, each cubed), nats: the density of their difference under their covariance, over
    /// that of an even spread. Where both are sharp, no chance brings them together to a few deviations. Not above any
    /// number where one is not finite.
    pub(crate) fn coincidence_nats(&self, other: &Self, volume: f64) -> f64 {
        let (difference, sum) = self.difference(other);
        let Some(factor) = floored(&sum).cholesky() else { return f64::NEG_INFINITY };
        let log_determinant =
            factor.l_dirty().diagonal().iter().map(|l| libm::log(2.0 * PI * l * l)).sum::<f64>();
        let distance_sq = difference.dot(&factor.solve(&difference));
        libm::log(volume) - 0.5 * (log_determinant + distance_sq)
    }

    /// Whether another estimate of the same pose, independent of this one, agrees.
    pub(crate) fn agrees(&self, other: &Self) -> bool {
        self.squared_distance(other) <= CHI_SQUARE_6
    }
}

/// Whether a relative pose, `older_from_newer`, agrees with that of the keyframes, each with its covariance: the two
/// add, for a track that is wrong states too little along itself, and what is right corrects it. Where either has none,
/// it does.
pub(crate) fn is_allowed(
    (newer, older): (&KeyframeState, &KeyframeState),
    older_from_newer: Pose,
    covariance: Matrix6,
) -> bool {
    let [from, to] = [older, newer].map(|k| UncertainPose::read(&k.world_from_camera, &k.covariance));
    let seen = UncertainPose { pose: older_from_newer, covariance };
    from.zip(to).is_none_or(|(from, to)| UncertainPose::apart(&from, &to).agrees(&seen))
}

/// `d^T C^-1 d`; infinite where a number is not finite.
fn squared_norm(d: &Vector6, covariance: &Matrix6) -> f64 {
    floored(covariance).cholesky().map_or(f64::INFINITY, |factor| d.dot(&factor.solve(d)))
}

/// A covariance that has an inverse: that of a first frame is singular.
fn floored(covariance: &Matrix6) -> Matrix6 {
    let floored = covariance + Matrix6::identity() * WindowSettings::CONVERGED_STEP.powi(2);
    (floored + floored.transpose()) * 0.5
}

/// A symmetric matrix without its negative eigenvalues.
fn positive(matrix: &Matrix6) -> Matrix6 {
    let eigen = SymmetricEigen::new((matrix + matrix.transpose()) * 0.5);
    let kept = eigen.eigenvalues.map(|value| value.max(0.0));
    eigen.eigenvectors * Matrix6::from_diagonal(&kept) * eigen.eigenvectors.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::{Twist, exp};

    fn uncertain(pose: Pose, sigmas: [f64; 6]) -> UncertainPose {
        let variances = Vector6::from(sigmas.map(|sigma| sigma * sigma));
        UncertainPose { pose, covariance: Matrix6::from_diagonal(&variances) }
    }

    fn at(x_m: f64, yaw_rad: f64) -> Pose {
        Pose::translation(x_m, 0.0, 0.0)
            * exp(&Twist::from_vector(&Vector6::new(0.0, 0.0, 0.0, 0.0, yaw_rad, 0.0)))
    }

    #[test]
    fn sharp_poses_coincide_by_no_chance_and_vague_ones_do() {
        let nats = |sigma: f64, x_m: f64| {
            let sigmas = [sigma; 6];
            uncertain(at(0.0, 0.0), sigmas).coincidence_nats(&uncertain(at(x_m, 0.0), sigmas), 2.0)
        };
        // Density of the difference at 0 over that of an even spread.
        let at_0 = libm::log(2.0) - 3.0 * libm::log(2.0 * PI * (2.0 * 0.01 * 0.01 + 1e-8));
        assert!((nats(0.01, 0.0) - at_0).abs() < 1e-9, "{}", nats(0.01, 0.0));
        assert!(nats(0.01, 0.07) > 0.0 && nats(0.01, 0.2) < 0.0);
        assert!(nats(0.5, 0.0) < 0.0, "they say no more than that both are in the region");
        assert!(!(nats(0.01, f64::NAN) > 0.0) && !(nats(f64::NAN, 0.0) > 0.0));
    }

    #[test]
    fn poses_agree_within_their_covariance_alone() {
        let sigmas = [0.01, 0.01, 0.01, 0.002, 0.002, 0.002];
        let known = uncertain(at(0.0, 0.0), sigmas);
        // Both are uncertain: 0.01 m each is 0.0141 m together.
        let near = uncertain(at(0.06, 0.0), sigmas);
        assert!((known.squared_distance(&near) - 18.0).abs() < 0.01, "{}", known.squared_distance(&near));
        assert!(known.agrees(&near) && !known.agrees(&uncertain(at(0.07, 0.0), sigmas)));
        assert!(!known.agrees(&uncertain(at(0.0, 0.02), sigmas)), "seven sigmas of rotation");
        // Along a corridor nothing is known.
        let slid = uncertain(at(3.0, 0.0), [2.0, 0.01, 0.01, 0.002, 0.002, 0.002]);
        assert!(known.agrees(&slid));
        assert!(!known.agrees(&uncertain(at(f64::NAN, 0.0), sigmas)));
    }

    #[test]
    fn what_two_poses_of_one_track_share_cancels() {
        let first = uncertain(at(1.0, 0.3), [0.5, 0.5, 0.5, 0.1, 0.1, 0.1]);
        let step = at(0.2, 0.1);
        let carry = adjoint(&step.inverse());
        let own = Matrix6::identity() * 1e-4;
        let covariance = carry * first.covariance * carry.transpose() + own;
        let second = UncertainPose { pose: first.pose * step, covariance };
        let along = UncertainPose::along_track(&first, &second);
        assert!((along.covariance - own).norm() < 1e-12);
        assert!((along.pose.inverse() * step).translation.vector.norm() < 1e-12);
        let apart = UncertainPose::apart(&first, &second);
        assert!(apart.covariance[(0, 0)] > 0.4);
        // One that was certain again since has lost what it inherited: nothing is negative.
        let certain = UncertainPose { covariance: own, ..second };
        let along = UncertainPose::along_track(&first, &certain);
        assert!(along.covariance.norm() < 1e-9);
    }
}
