//! Gravity as a residual of keyframes (method 8.5): what accelerometers measured holds roll and pitch of all.
//!
//! Each run has one vertical in a component and one constant error of its accelerometer, both free, so that nothing
//! moves the first keyframe. The mean force of which a direction is made takes [`UpDirection::LONGEST_S`]: directions
//! nearer in time are of the same forces, so that one counts for all of them. What two that follow each other disagree
//! by, with the turn between them as the poses have it, is noise and hardly drift: the median of its square, over that
//! of a chi-square of two axes, estimates the factor of the stated variances.

use crate::estimation::noise_scales::PRIOR_FREEDOM;
use crate::estimation::student;
use crate::map::context::Context;
use crate::map::state::KeyframeState;
use crate::map::submaps::Submaps;
use nalgebra::{UnitQuaternion, Vector3};
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
    in_world: Vector3<f64>,
    variance: f64,
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
                in_world: Pose::from(&keyframe.world_from_camera).rotation * in_camera,
                variance: sigma_rad * sigma_rad,
            };
            runs.entry((submaps.component(keyframe.submap), keyframe.session)).or_default().push(measured);
        }
        let unit = context.scales.surfaces * context.matcher().metric_factor();
        let ups = Ups { measured: Vec::new(), freedom: student::FREEDOM, unit };
        let mut gravity = Self { ups, ..Self::default() };
        runs.into_values().for_each(|ups| gravity.add(independent(ups), keyframes.len()));
        gravity
    }

    /// Adds the accelerometer of a run, whose vertex is behind those of so many keyframes.
    fn add(&mut self, ups: Vec<MeasuredUp>, n_keyframes: usize) {
        let instrument = n_keyframes + self.instruments.len();
        let sum: Vector3<f64> = ups.iter().map(|up| up.in_world / up.variance).sum();
        let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &sum).unwrap_or_else(half_turn);
        let predicted = Pose::from_parts(Vector3::zeros().into(), turn);
        // The constant error is a part of each deviation.
        let least = ups.iter().map(|up| up.variance).fold(f64::INFINITY, f64::min);
        let of_error = self.ups.unit / least;
        let known = Vector6::new(of_error, of_error, of_error, 0.0, 0.0, of_error);
        let information = Matrix6::from_diagonal(&known);
        self.instruments.push(predicted);
        self.priors.push(Prior { vertex: instrument, predicted, information });
        let factor = variance_factor(&ups);
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

/// Factor of the stated variances, by what neighbours in time disagree by; 1 where too little is known.
fn variance_factor(ups: &[MeasuredUp]) -> f64 {
    let apart = |pair: &[MeasuredUp]| match pair {
        [a, b] => (a.in_world - b.in_world).norm_squared() / (a.variance + b.variance),
        _ => 0.0,
    };
    let mut squared: Vec<f64> = ups.windows(2).map(apart).collect();
    squared.sort_by(f64::total_cmp);
    let Some(median) = squared.get(squared.len() / 2) else { return 1.0 };
    // The median of a chi-square of two axes is 2 ln 2.
    let (axes, found) = (2.0 * squared.len() as f64, median / (2.0 * LN_2));
    (axes * found + PRIOR_FREEDOM) / (axes + PRIOR_FREEDOM)
}
