//! Covariance of a frame's pose in the world (method 9.3).
//!
//! The covariance of the window, carried over to the frame, plus that of the alignment, plus what all
//! matches err by together ([`systematic`]). The errors of the window's members are correlated, so
//! the most certain of them counts, once.

use crate::estimation::colour_model::ColourState;
use crate::map::cause::MotionKind;
use crate::map::context::Context;
use crate::map::map_view::MapView;
use crate::map::state::MOST_COASTED_S;
use crate::pairs::keyframe_pair::MIN_FEATURES;
use crate::settings::GlobalSettings;
use crate::tracking::alignment::Alignment;
use crate::tracking::degeneracy::{DegenerateDirection, centroid};
use crate::tracking::input::FrameSurface;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::WindowAlignment;
use tessera_geometry::{Matrix6, Pose, Vector6, adjoint, from_upper_triangle};
use tessera_graph::BlockSums;

/// Covariance of the frame's pose in the world, in the tangent of its camera, translation first.
///
/// `own`: covariance of the alignment against fixed references, degenerate directions held.
pub(crate) fn of_world(
    map: &MapView<'_>,
    aligned: &WindowAlignment,
    own: &Matrix6,
    context: &Context,
    frame: &FrameSurface<'_>,
) -> Matrix6 {
    let a = &aligned.alignment;
    let is_seen = a.n_agreeing >= MIN_FEATURES;
    let is_good = |place: usize| {
        let [n_matches, n_queries] = [a.reports[place].n_matches, a.reports[place].n_queries].map(f64::from);
        is_seen || n_matches >= GlobalSettings::MIN_OVERLAP * n_queries
    };
    let deviation = map.state().motion.velocity_deviation();
    let last = map.state().recent.last().map_or(frame.stamp_nanos, |last| last.stamp_nanos);
    let seconds = (frame.stamp_nanos.saturating_sub(last) as f64 * 1e-9).clamp(0.0, MOST_COASTED_S);
    let inherited =
        aligned.members.iter().enumerate().filter(|(place, _)| is_good(*place)).filter_map(|(_, member)| {
            let (pose, numbers, index) = match member {
                Member::Recent(place) => {
                    let r = map.state().recent.get(*place)?;
                    (&r.world_from_camera, &r.covariance, r.index)
                }
                Member::Keyframe(id) => {
                    let k = map.keyframe(*id)?;
                    // A keyframe of an earlier run: as old as this run at least.
                    let index = if map.is_own(k) { k.frame_index } else { 0 };
                    (&k.world_from_camera, &k.covariance, index)
                }
            };
            let ad = adjoint(&(a.world_from_camera.inverse() * Pose::from(pose)));
            let mut carried = ad * from_upper_triangle(numbers) * ad.transpose();
            let n_frames = frame.index.saturating_sub(index).max(1) as f64;
            for direction in &a.degenerate {
                let per_frame = per_frame(direction, &deviation, a.rotation_sigma_rad, seconds);
                drift(direction, per_frame * n_frames, &mut carried);
            }
            Some(carried)
        });
    let best = inherited.min_by(|x, y| x.trace().total_cmp(&y.trace()));
    let sum = best.unwrap_or_else(Matrix6::zeros) + own + systematic(&map.state().colour, context, a);
    (sum + sum.transpose()) * 0.5
}

/// Residual of features that match as well as they can, pixels.
const MATCHING_PX: f64 = 1.0;
/// Factor from the median disagreement of colour with depth to a standard deviation.
const OF_MEDIAN: f64 = 1.5;

/// Covariance of what no number of matches averages out: errors of the calibration and of the stamps.
///
/// Both show where colour disagrees with depth. The residual of features against the surfaces beyond
/// that of matching is an angle `d`: it turns the camera by `d` and moves it by `d` times the
/// distance of what it sees. A lag between the images is an error of a stamp, beside that of the stamps of depth: it
/// moves the camera by its velocity times the lag. Of colour that is not trusted the residual is what it was before
/// anything was measured. Without colour nothing is known of calibration and lag, and nothing is added for them.
pub(crate) fn systematic(colour: &ColourState, context: &Context, a: &Alignment) -> Matrix6 {
    let late = |seconds: f64| a.velocity.to_vector() * seconds;
    let of_stamp = late(context.stamp_sigma_s) * late(context.stamp_sigma_s).transpose();
    if colour.n_frames == 0 {
        return of_stamp;
    }
    let sums: Vec<&BlockSums> = a.blocks.iter().map(|(_, sums)| sums).collect();
    let of_lag = late(colour.model.lag_s) * late(colour.model.lag_s).transpose();
    of_calibration(colour, context, &sums) + of_lag + of_stamp
}

/// The part of [`systematic`] that is of the calibration, of matches with such sums.
pub(crate) fn of_calibration(colour: &ColourState, context: &Context, sums: &[&BlockSums]) -> Matrix6 {
    let residual_px =
        if colour.is_trusted() { colour.residual_px } else { ColourState::default().residual_px };
    let angle_rad = OF_MEDIAN * (residual_px - MATCHING_PX).max(0.0) / context.camera.focal_px();
    let distance_m = centroid(sums.iter().copied()).norm();
    let (t, r) = ((angle_rad * distance_m).powi(2), angle_rad * angle_rad);
    Matrix6::from_diagonal(&Vector6::new(t, t, t, r, r, r))
}

/// Standard deviation of a degenerate direction's motion in one frame of so many seconds: the velocity's, or that of a
/// rotation that a gyroscope measured.
fn per_frame(
    direction: &DegenerateDirection,
    velocity_deviation: &[f64; 6],
    measured_rad: Option<f64>,
    seconds: f64,
) -> f64 {
    let along = |first: usize| {
        let parts = direction.motion.axis.iter().zip(&velocity_deviation[first..]);
        parts.map(|(axis, deviation)| (axis * deviation).powi(2)).sum::<f64>().sqrt() * seconds
    };
    match direction.motion.kind {
        MotionKind::Translation => along(0),
        MotionKind::Rotation => measured_rad.unwrap_or_else(|| along(3)),
    }
}

/// A direction that only the prediction holds drifts with an unknown, steady velocity: its
/// standard deviation, not its variance, grows in proportion to time.
fn drift(direction: &DegenerateDirection, deviation: f64, covariance: &mut Matrix6) {
    let before = (direction.coordinate.dot(&(*covariance * direction.coordinate))).max(0.0);
    let after = before.sqrt() + deviation;
    *covariance += direction.tangent * direction.tangent.transpose() * (after * after - before);
}
