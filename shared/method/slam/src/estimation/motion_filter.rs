//! The camera's velocity and how far a prediction by it errs: a Kalman filter of constant velocity for each axis of
//! the camera, whose noise levels are estimated from its innovations (method 6.1).
//!
//! Between frames the velocity changes by white acceleration of density `q`; with the variances `P_pp`, `P_pv` and
//! `P_vv` of pose and velocity (Bar-Shalom, Li and Kirubarajan 2001, 6.2.2)
//!
//! ```text
//! P_pp' = P_pp + 2 P_pv t + P_vv t^2 + q t^3 / 3,   P_pv' = P_pv + P_vv t + q t^2 / 2,   P_vv' = P_vv + q t.
//! ```
//!
//! The alignment has the predicted pose as a prior with the variance `P_pp'`: its solution is the filter's updated
//! pose, and `s` times its covariance the updated `P_pp`. So the gain is `K = 1 - P_pp / P_pp'`, the innovation is the
//! step from the prediction over `K`, and its variance is `S = P_pp' / K`.
//!
//! An innovation `u` in units of `sqrt(S)` has a mean square of 1 where `s` is right, and is uncorrelated with the one
//! before where `q` is (Mehra, IEEE Trans. Automatic Control 1970): a smaller `q` leaves a lag behind. Both are
//! followed in logarithms, for translation and rotation apart. What the mean square is off by is divided as `S` is: of
//! it `K S` is the prediction's and `(1 - K) S` the pose's, so that where one of them is small it is left alone.

use crate::estimation::FORGETTING;
use crate::estimation::student::{FREEDOM, THREE_AXES};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use std::ops::Range;
use tessera_geometry::{Pose, Twist, Vector6, exp, log};

/// Time between two frames of a usual camera, seconds.
pub(crate) const FRAME_S: f64 = 1.0 / 30.0;
/// Acceleration before anything is known, m/s^2 and rad/s^2, that lasts from one frame to the next.
const START_ACCELERATION: [f64; 2] = [2.0, 10.0];
/// Standard deviation of a velocity that no alignment determines, m/s and rad/s: of a hand or a robot indoors.
const START_VELOCITY: [f64; 2] = [1.5, 1.5];
/// Standard deviation of a rotation between two frames that no gyroscope falls below, radians: its axes and the camera's
/// differ a little.
const INERTIAL_FLOOR_RAD: f64 = 0.2_f64.to_radians();

/// Velocity and its noise levels as of all frames so far. Arrays by axis: along x, y, z, and about them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MotionState {
    /// Frames in a row from which the velocity is known, the older the less; 0: it is not.
    n_frames: f64,
    velocity: [f64; 6],
    /// `P_pp`, `P_pv` and `P_vv`.
    variance: [[f64; 3]; 6],
    /// The last innovation in units of its deviation.
    innovation: [f64; 6],
    /// Logarithm of `s`, of translation and of rotation.
    ln_scale: [f64; 2],
    /// Logarithm of `q` over its start.
    ln_density: [f64; 2],
}

/// The pose that a motion leads to.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MotionPrior {
    pub(crate) world_from_camera: Pose,
    /// Variance along and about each axis of the camera, m^2 and rad^2.
    pub(crate) variance: [f64; 6],
    /// Frames in a row that were where it led, the older the less.
    n_frames: f64,
}

impl MotionPrior {
    /// Squared distance of a pose from this one in units of its deviations.
    pub(crate) fn squared_distance(&self, world_from_camera: &Pose) -> f64 {
        let step = log(&(self.world_from_camera.inverse() * world_from_camera)).to_vector();
        step.iter().zip(&self.variance).map(|(step, variance)| step * step / variance).sum()
    }

    /// Log-likelihood ratio of a pose for this motion against one anywhere in a region of so much volume (metres and
    /// radians, each cubed), nats: Student's t for translation and rotation apart, as the innovations have it, over an
    /// even spread.
    pub(crate) fn coincidence_nats(&self, world_from_camera: &Pose, volume: f64) -> f64 {
        let step = log(&(self.world_from_camera.inverse() * world_from_camera)).to_vector();
        let half = |axes: Range<usize>| {
            let (n, nu) = (axes.len() as f64, FREEDOM);
            let distance_sq: f64 = axes.clone().map(|k| step[k] * step[k] / self.variance[k]).sum();
            let log_scale: f64 = axes.map(|k| libm::log(PI * nu * self.variance[k])).sum();
            let log_norm = libm::lgamma(0.5 * (nu + n)) - libm::lgamma(0.5 * nu);
            log_norm - 0.5 * log_scale - 0.5 * (nu + n) * libm::log1p(distance_sq / nu)
        };
        libm::log(volume) + half(0..3) + half(3..6)
    }

    /// As [`Self::coincidence_nats`], and that the next frame is on the track: so many were (Laplace's rule of succession).
    pub(crate) fn track_nats(&self, world_from_camera: &Pose, volume: f64) -> f64 {
        libm::log1p(self.n_frames) + self.coincidence_nats(world_from_camera, volume)
    }

    /// The same with the rotation of another pose, which a gyroscope measured.
    pub(crate) fn turned(self, world_from_camera: &Pose, sigma_rad: f64) -> Self {
        let mut variance = self.variance;
        variance[3..].fill(sigma_rad * sigma_rad + INERTIAL_FLOOR_RAD * INERTIAL_FLOOR_RAD);
        Self { world_from_camera: *world_from_camera, variance, ..self }
    }
}

impl MotionState {
    /// Where the camera is `seconds` after `last_pose`; `None` without a velocity.
    pub(crate) fn predict(&self, last_pose: &Pose, seconds: f64) -> Option<MotionPrior> {
        let ahead: [[f64; 3]; 6] = std::array::from_fn(|k| self.ahead(k, seconds));
        let velocity = Twist::from_vector(&Vector6::from(self.velocity));
        self.is_known().then(|| MotionPrior {
            world_from_camera: last_pose * exp(&velocity.scaled(seconds)),
            variance: ahead.map(|[pp, ..]| pp),
            n_frames: self.n_frames,
        })
    }

    /// Factors of the alignment's covariance, of translation and rotation.
    pub(crate) fn scale(&self) -> [f64; 2] {
        self.ln_scale.map(libm::exp)
    }

    /// Standard deviation of the velocity along and about each axis, m/s and rad/s.
    pub(crate) fn velocity_deviation(&self) -> [f64; 6] {
        let deviation = self.variance.map(|[.., vv]| vv.sqrt());
        if self.is_known() { deviation } else { std::array::from_fn(|k| START_VELOCITY[k / 3]) }
    }

    /// Takes in a pose `step` further than the one before, found `seconds` later with these variances as the
    /// alignment states them; `None`: some direction was not measured.
    pub(crate) fn apply(&mut self, step: &Vector6, stated: Option<&[f64; 6]>, seconds: f64) {
        let velocity = step / seconds;
        let scale = self.scale();
        let n_frames = (1.0 - FORGETTING) * self.n_frames + 1.0;
        match stated {
            Some(stated) if self.is_known() => {
                let (innovation, gain) = self.update(&velocity, stated, seconds);
                self.learn(innovation, &gain);
            }
            None if self.is_known() => {
                self.coast(seconds);
                self.velocity = velocity.into();
            }
            _ => {
                let start = |k: usize| match stated.map(|stated| scale[k / 3] * stated[k]) {
                    Some(r) => [r, r / seconds, 2.0 * r / seconds.powi(2)],
                    None => [0.0, 0.0, START_VELOCITY[k / 3].powi(2)],
                };
                *self = Self {
                    velocity: velocity.into(),
                    variance: std::array::from_fn(start),
                    innovation: [0.0; 6],
                    ..*self
                };
            }
        }
        self.n_frames = n_frames;
    }

    /// A time without a measurement.
    pub(crate) fn coast(&mut self, seconds: f64) {
        self.variance = std::array::from_fn(|k| self.ahead(k, seconds));
        self.innovation = [0.0; 6];
    }

    fn is_known(&self) -> bool {
        self.n_frames > 0.0
    }

    /// Nothing leads to the next pose.
    pub(crate) fn forget(&mut self) {
        self.n_frames = 0.0;
    }

    /// The variances of an axis some time later.
    fn ahead(&self, axis: usize, t: f64) -> [f64; 3] {
        let [pp, pv, vv] = self.variance[axis];
        let q = START_ACCELERATION[axis / 3].powi(2) * FRAME_S * libm::exp(self.ln_density[axis / 3]);
        [pp + 2.0 * pv * t + vv * t * t + q * t.powi(3) / 3.0, pv + vv * t + q * t * t / 2.0, vv + q * t]
    }

    /// The filter's update; the innovation in units of its deviation, and the gain, of each axis.
    fn update(&mut self, velocity: &Vector6, stated: &[f64; 6], seconds: f64) -> ([f64; 6], [f64; 6]) {
        let scale = self.scale();
        let mut gains = [0.0; 6];
        let innovation = std::array::from_fn(|k| {
            let [pp, pv, vv] = self.ahead(k, seconds);
            // However little an alignment tells, it is no less than what is forgotten.
            let updated = (scale[k / 3] * stated[k]).min((1.0 - FORGETTING) * pp);
            let gain = 1.0 - updated / pp;
            let step = (velocity[k] - self.velocity[k]) * seconds;
            self.velocity[k] += pv / pp * step;
            self.variance[k] = [updated, pv * (1.0 - gain), vv - pv * pv * gain / pp];
            gains[k] = gain;
            step / (pp * gain).sqrt()
        });
        (innovation, gains)
    }

    /// Follows the noise levels.
    fn learn(&mut self, mut innovation: [f64; 6], gain: &[f64; 6]) {
        for group in 0..2 {
            let axes = 3 * group..3 * group + 3;
            let squared: f64 = axes.clone().map(|k| innovation[k].powi(2)).sum();
            let of_motion = gain[axes.clone()].iter().sum::<f64>() / 3.0;
            let weight = THREE_AXES.weight(squared);
            axes.clone().for_each(|k| innovation[k] *= weight.sqrt().min(1.0));
            let correlation = axes.map(|k| innovation[k] * self.innovation[k]).sum::<f64>() / 3.0;
            let excess = THREE_AXES.consistency * weight * squared / 3.0 - 1.0;
            self.ln_scale[group] += FORGETTING * (1.0 - of_motion) * excess;
            self.ln_density[group] += FORGETTING * (of_motion * excess + correlation);
        }
        self.innovation = innovation;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    fn normal(random: &mut SplitMix64) -> f64 {
        (0..12).map(|_| random.next_u64() as f64 / u64::MAX as f64).sum::<f64>() - 6.0
    }

    /// A camera whose velocity changes by `acceleration` (m/s^2 and rad/s^2) from frame to frame, `t` seconds apart, and
    /// whose poses err by `sigma`, where the alignment states `stated`: the state after 5,400 frames.
    fn filtered(acceleration: f64, sigma: f64, stated: f64, t: f64) -> MotionState {
        let mut random = SplitMix64::for_frame(3, 1);
        let mut state = MotionState::default();
        let (mut velocity, mut pose, mut found) = ([0.0; 6], [0.0; 6], [0.0; 6]);
        for _ in 0..5400 {
            let mut after = [0.0; 6];
            let mut variance = [stated * stated; 6];
            let predicted = state.predict(&Pose::identity(), t);
            for k in 0..6 {
                velocity[k] += acceleration * t * normal(&mut random);
                pose[k] += velocity[k] * t;
                let measured = pose[k] + sigma * normal(&mut random);
                after[k] = measured;
                if let Some(prior) = &predicted {
                    // The alignment's least squares, its information scaled as the tracker does.
                    let measured_variance = stated * stated * state.scale()[k / 3];
                    let gain = prior.variance[k] / (prior.variance[k] + measured_variance);
                    let expected = found[k] + state.velocity[k] * t;
                    after[k] = expected + gain * (measured - expected);
                    variance[k] *= gain;
                }
            }
            let step = Vector6::from_fn(|k, _| after[k] - found[k]);
            state.apply(&step, Some(&variance), t);
            found = after;
        }
        state
    }

    #[test]
    fn planted_noise_levels_are_found() {
        for (acceleration, sigma) in [(1.0, 0.002), (1.0, 0.01), (4.0, 0.005), (0.3, 0.003)] {
            for stated in [sigma, 0.3 * sigma, 3.0 * sigma] {
                let state = filtered(acceleration, sigma, stated, FRAME_S);
                for group in 0..2 {
                    let found = (state.scale()[group]).sqrt() * stated;
                    assert!(
                        (0.7..1.4).contains(&(found / sigma)),
                        "{acceleration} {sigma} {stated}: {found}"
                    );
                    let density =
                        START_ACCELERATION[group].powi(2) * FRAME_S * libm::exp(state.ln_density[group]);
                    let found = (density * 30.0).sqrt();
                    assert!((0.5..2.0).contains(&(found / acceleration)), "{acceleration} {sigma}: {found}");
                }
            }
        }
    }

    #[test]
    fn where_motion_alone_makes_the_innovations_the_noise_of_poses_stays_as_it_was() {
        // 0.8 s from frame to frame: predictions err by decimetres, poses by millimetres.
        for acceleration in [0.02, 0.1, 1.0] {
            let state = filtered(acceleration, 0.005, 0.005, 0.8);
            let [translation, rotation] = state.scale();
            assert!((0.1..10.0).contains(&translation) && (0.1..10.0).contains(&rotation), "{state:?}");
            for group in 0..2 {
                let density =
                    START_ACCELERATION[group].powi(2) * FRAME_S * libm::exp(state.ln_density[group]);
                let found = (density / 0.8).sqrt();
                assert!((0.5..2.0).contains(&(found / acceleration)), "{acceleration}: {found}");
            }
        }
    }

    #[test]
    fn a_time_without_a_measurement_is_uncertain_and_a_velocity_forgotten_predicts_nothing() {
        let mut state = filtered(1.0, 0.005, 0.005, FRAME_S);
        let variance = |state: &MotionState| state.predict(&Pose::identity(), 0.1).map(|p| p.variance[0]);
        let before = variance(&state).unwrap();
        state.coast(0.2);
        assert!(variance(&state).unwrap() > 2.0 * before);
        state.forget();
        assert_eq!(variance(&state), None);
    }

    #[test]
    fn a_track_is_its_own_prior_as_far_as_it_is_remembered() {
        let pose = Pose::identity();
        let prior = |state: &MotionState| {
            let motion = state.predict(&pose, FRAME_S).unwrap();
            motion.track_nats(&pose, 1.0) - motion.coincidence_nats(&pose, 1.0)
        };
        let mut first = MotionState::default();
        first.apply(&Vector6::zeros(), Some(&[1e-6; 6]), FRAME_S);
        assert!((prior(&first) - libm::log(2.0)).abs() < 1e-9, "{}", prior(&first));
        let long = prior(&filtered(1.0, 0.005, 0.005, FRAME_S));
        assert!((long - libm::log(101.0)).abs() < 1e-9, "{long}");
    }
}
