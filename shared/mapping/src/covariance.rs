//! How well a frame's pose in the world is known.
//!
//! What the window knows of itself, carried over to the frame, plus what the alignment adds. The
//! window's members err together, so the best known of them counts, once.

use crate::attempt::Attempt;
use crate::degeneracy::{FreeDirection, Motion};
use crate::settings::WindowSettings;
use crate::state::TrackerState;
use crate::window::Member;
use tessera_geometry::{Matrix6, Pose, adjoint};

/// 21 numbers, row by row.
pub(crate) fn upper_triangle(m: &Matrix6) -> Vec<f64> {
    (0..6).flat_map(|r| (r..6).map(move |c| (r, c))).map(|(r, c)| m[(r, c)]).collect()
}

/// The inverse of [`upper_triangle`]; zero for anything but 21 numbers.
pub(crate) fn from_upper_triangle(numbers: &[f64]) -> Matrix6 {
    let mut m = Matrix6::zeros();
    if numbers.len() == 21 {
        let places = (0..6).flat_map(|r| (r..6).map(move |c| (r, c)));
        for ((r, c), value) in places.zip(numbers) {
            m[(r, c)] = *value;
            m[(c, r)] = *value;
        }
    }
    m
}

/// Covariance of the frame's pose in the world, in the tangent of its camera, translation first.
///
/// `own`: covariance of the alignment against fixed references, free directions held.
pub(crate) fn of_world(
    settings: &WindowSettings,
    state: &TrackerState,
    attempt: &Attempt,
    own: &Matrix6,
    frame_index: u64,
) -> Matrix6 {
    let a = &attempt.alignment;
    let is_good = |place: usize| a.reports[place].n_matches * 5 >= a.reports[place].n_queries;
    let inherited =
        attempt.members.iter().enumerate().filter(|(place, _)| is_good(*place)).filter_map(|(_, member)| {
            let (pose, numbers, index) = match member {
                Member::Recent(place) => {
                    let r = state.recent.get(*place)?;
                    (&r.world_from_camera, &r.covariance, r.index)
                }
                Member::Keyframe(id) => {
                    let k = state.keyframes.get(*id as usize)?;
                    // A keyframe of an earlier run: as old as this run at least.
                    let index = if state.is_own(k) { k.frame_index } else { 0 };
                    (&k.world_from_camera, &k.covariance, index)
                }
            };
            let ad = adjoint(&(a.world_from_camera.inverse() * Pose::from(pose)));
            let mut carried = ad * from_upper_triangle(numbers) * ad.transpose();
            let n_frames = frame_index.saturating_sub(index).max(1) as f64;
            for free in &a.free {
                drift(settings, free, a.rotation_sigma_rad, n_frames, &mut carried);
            }
            Some(carried)
        });
    let best = inherited.min_by(|x, y| x.trace().total_cmp(&y.trace()));
    let sum = best.unwrap_or_else(Matrix6::zeros) + own;
    (sum + sum.transpose()) * 0.5
}

/// A direction that only the prediction holds drifts with an unknown, steady velocity: its
/// standard deviation, not its variance, grows in proportion to time.
fn drift(
    settings: &WindowSettings,
    free: &FreeDirection,
    measured_rad: Option<f64>,
    n_frames: f64,
    covariance: &mut Matrix6,
) {
    let per_frame = match free.motion {
        Motion::Translation => settings.prior_translation_m,
        Motion::Rotation => measured_rad.unwrap_or(settings.prior_rotation_deg.to_radians()),
    };
    let before = (free.coordinate.dot(&(*covariance * free.coordinate))).max(0.0);
    let after = before.sqrt() + per_frame * n_frames;
    *covariance += free.tangent * free.tangent.transpose() * (after * after - before);
}
