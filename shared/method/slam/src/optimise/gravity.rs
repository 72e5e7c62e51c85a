//! Gravity as a residual of keyframes (method 12.5): what accelerometers measured holds roll and pitch of all.
//!
//! Each run has one vertical in a component and one constant error of its accelerometer, both free, so that nothing
//! moves the first keyframe. The mean force of which a direction is made takes [`UpDirection::LONGEST_S`]: directions
//! nearer in time are of the same forces, so that one counts for all of them. What two that follow each other disagree
//! by, with the turn between them as the poses have it, is the constant error, which turns with the camera, and noise,
//! and hardly drift: the median of its square, over that of a chi-square of two axes, estimates the factor of the stated
//! variances.

use crate::estimation::noise_scales::PRIOR_FREEDOM;
use crate::estimation::student;
use crate::map::context::Context;
use crate::map::state::KeyframeState;
use crate::map::submaps::Submaps;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::f64::consts::LN_2;
use tessera_geometry::{Matrix6, Pose, UpDirection, Vector6};
use tessera_graph::{Prior, Up, Ups};

/// What accelerometers add to the graph of all keyframes.
#[derive(Default)]
pub(crate) struct Gravity {
    /// Where the vertices of the accelerometers begin; they are behind all others.
    pub(crate) instruments: Vec<Pose>,
    /// Of their constant errors, and of the turns about their verticals, which nothing measures.
    pub(crate) priors: Vec<Prior>,
    pub(crate) ups: Ups,
}

/// Up at one keyframe.
struct MeasuredUp {
    vertex: usize,
    stamp_nanos: i64,
    in_camera: Vector3<f64>,
    world_from_camera: UnitQuaternion<f64>,
    variance: f64,
}

impl MeasuredUp {
    fn in_world(&self) -> Vector3<f64> {
        self.world_from_camera * self.in_camera
    }

    /// What a constant error in the camera's axes turns up of the world by.
    fn across(&self) -> Matrix3<f64> {
        let across = Matrix3::identity() - self.in_camera * self.in_camera.transpose();
        self.world_from_camera.to_rotation_matrix().into_inner() * across
    }
}

impl Gravity {
    /// Of the keyframes that are the first vertices of a graph, at the poses that they have.
    pub(crate) fn of(context: &Context, keyframes: &[&KeyframeState], submaps: &Submaps) -> Self {
        let mut runs = BTreeMap::<(u32, u32), Vec<MeasuredUp>>::new();
        for (vertex, keyframe) in keyframes.iter().enumerate() {
            let up = keyframe.up.filter(UpDirection::is_valid);
            let Some(UpDirection { in_camera, sigma_rad }) = up else { continue };
            let in_camera = Vector3::from(in_camera);
            let measured = MeasuredUp {
                vertex,
                stamp_nanos: keyframe.stamp_nanos,
                in_camera,
                world_from_camera: Pose::from(&keyframe.world_from_camera).rotation,
                variance: sigma_rad * sigma_rad,
            };
            runs.entry((submaps.component(keyframe.submap), keyframe.session)).or_default().push(measured);
        }
        let unit = context.scales.surfaces * context.matcher().metric_factor();
        let (freedom, prior_freedom) = (student::FREEDOM, PRIOR_FREEDOM);
        let ups = Ups { measured: Vec::new(), freedom, unit, weight: 1.0, prior_freedom };
        let mut gravity = Self { ups, ..Self::default() };
        runs.into_values().for_each(|ups| gravity.add(independent(ups), keyframes.len()));
        gravity
    }

    /// Adds the accelerometer of a run, whose vertex is behind those of so many keyframes.
    fn add(&mut self, ups: Vec<MeasuredUp>, n_keyframes: usize) {
        let instrument = n_keyframes + self.instruments.len();
        let sum: Vector3<f64> = ups.iter().map(|up| up.in_world() / up.variance).sum();
        let level_from_world = UpDirection::of(&sum, 1.0).map(|up| up.levelled(&UnitQuaternion::identity()));
        let world_from_level = level_from_world.unwrap_or_default().inverse();
        let predicted = Pose::from_parts(Vector3::zeros().into(), world_from_level);
        // The constant error is a part of each deviation.
        let least = ups.iter().map(|up| up.variance).fold(f64::INFINITY, f64::min);
        let of_error = self.ups.unit / least;
        let known = Vector6::new(of_error, of_error, of_error, 0.0, of_error, 0.0);
        let information = Matrix6::from_diagonal(&known);
        self.instruments.push(predicted);
        self.priors.push(Prior { vertex: instrument, predicted, information });
        let factor = variance_factor(&ups, least);
        self.ups.measured.extend(ups.iter().map(|up| Up {
            vertex: up.vertex,
            instrument,
            in_camera: up.in_camera,
            sigma_rad: (factor * up.variance).sqrt(),
        }));
    }
}

/// Those that are of other forces than the one before, in the order of time.
fn independent(mut ups: Vec<MeasuredUp>) -> Vec<MeasuredUp> {
    ups.sort_by_key(|up| up.stamp_nanos);
    let mut last = None;
    ups.retain(|up| {
        let seconds = |last: i64| up.stamp_nanos.saturating_sub(last) as f64 * 1e-9;
        let is_new = last.is_none_or(|last| seconds(last) >= UpDirection::LONGEST_S);
        last = if is_new { Some(up.stamp_nanos) } else { last };
        is_new
    });
    ups
}

/// Factor of the stated variances, by what neighbours in time disagree by beyond the constant error that fits them
/// best; 1 where too little is known.
fn variance_factor(ups: &[MeasuredUp], variance_of_error: f64) -> f64 {
    // Both directions in the world, where the constant error turns with the camera: `d = A b`.
    let apart = |pair: &[MeasuredUp]| match pair {
        [a, b] => Some((a.in_world() - b.in_world(), a.across() - b.across(), a.variance + b.variance)),
        _ => None,
    };
    let pairs: Vec<(Vector3<f64>, Matrix3<f64>, f64)> = ups.windows(2).filter_map(apart).collect();
    let factor = |error: &Vector3<f64>| {
        let of = |(d, by_error, variance): &(Vector3<f64>, Matrix3<f64>, f64)| {
            (d - by_error * error).norm_squared() / variance
        };
        let mut squared: Vec<f64> = pairs.iter().map(of).collect();
        squared.sort_by(f64::total_cmp);
        // The median of a chi-square of two axes is 2 ln 2.
        let found = squared.get(squared.len() / 2).map_or(0.0, |median| median / (2.0 * LN_2));
        let axes = 2.0 * squared.len() as f64;
        (axes * found + PRIOR_FREEDOM) / (axes + PRIOR_FREEDOM)
    };
    // Under the variance without it: an accelerometer that is not as it states must not be explained by its error.
    let without = factor(&Vector3::zeros());
    let (mut h, mut g) = (Matrix3::identity() / variance_of_error, Vector3::zeros());
    for (d, by_error, variance) in &pairs {
        h += by_error.transpose() * by_error / (without * variance);
        g += by_error.transpose() * d / (without * variance);
    }
    h.cholesky().map_or(without, |h| factor(&h.solve(&g)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::{context, keyframe};
    use tessera_numerics::SplitMix64;

    /// A keyframe each two seconds, level but for what `lean` adds to up, radians about x.
    fn keyframes(n: u32, lean: impl Fn(u32) -> f64) -> Vec<KeyframeState> {
        let made = |id: u32| {
            let up = UpDirection::of(&Vector3::new(0.0, -1.0, lean(id)), 0.02);
            KeyframeState { stamp_nanos: 2_000_000_000 * i64::from(id), up, ..keyframe(id, 0, 0.0) }
        };
        (0..n).map(made).collect()
    }

    fn gravity(keyframes: &[KeyframeState]) -> Gravity {
        let keyframes: Vec<&KeyframeState> = keyframes.iter().collect();
        let mut submaps = Submaps::default();
        submaps.extend_to(1);
        Gravity::of(&context(), &keyframes, &submaps)
    }

    #[test]
    fn forces_that_two_directions_share_count_once() {
        let found = gravity(&keyframes(7, |_| 0.0));
        let vertices: Vec<usize> = found.ups.measured.iter().map(|up| up.vertex).collect();
        assert_eq!(vertices, [0, 2, 4, 6]);
        assert!(found.ups.measured.iter().all(|up| up.instrument == 7));
        let up = found.instruments[0].rotation * -Vector3::y();
        assert!((up + Vector3::y()).norm() < 1e-12, "{up}");
    }

    #[test]
    fn each_run_has_a_vertical_in_each_component() {
        let mut all = keyframes(8, |_| 0.0);
        (all[2].session, all[5].session) = (1, 1);
        all[6].submap = 1;
        all[3].up = None;
        all[4].up = Some(UpDirection { in_camera: [f64::NAN, 0.0, 0.0], sigma_rad: 0.02 });
        let found = gravity(&all);
        let measured: Vec<_> = found.ups.measured.iter().map(|up| (up.vertex, up.instrument)).collect();
        assert_eq!(measured, [(0, 8), (7, 8), (2, 9), (5, 9), (6, 10)]);
        assert_eq!(found.priors.iter().map(|prior| prior.vertex).collect::<Vec<_>>(), [8, 9, 10]);
        for none in [&all[3..4], &all[..0]] {
            assert!(gravity(none).instruments.is_empty() && gravity(none).ups.measured.is_empty());
        }
    }

    #[test]
    fn the_variance_is_that_of_neighbours_and_not_of_drift() {
        let mut random = SplitMix64::new(3);
        let noise: Vec<f64> = (0..400).map(|_| (0..12).map(|_| random.unit()).sum::<f64>() - 6.0).collect();
        let sigma = |sigma: f64, drift: f64| {
            let lean = |id: u32| sigma * noise[id as usize] + drift * f64::from(id);
            // The noise is about one of two axes.
            gravity(&keyframes(400, lean)).ups.measured[0].sigma_rad
        };
        let (small, usual, drifting) = (sigma(0.002, 0.0), sigma(0.02, 0.0), sigma(0.002, 0.0005));
        assert!((0.004..0.008).contains(&small), "{small}");
        assert!((0.01..0.02).contains(&usual), "{usual}");
        assert!((drifting - small).abs() < 0.1 * small, "{drifting}, {small} without drift");
        let worse = sigma(0.3, 0.0);
        assert!(worse > 0.1, "{worse}: an accelerometer that is not as it states");
    }
}
