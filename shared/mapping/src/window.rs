//! The local window: which fixed poses a new frame is aligned to (SPEC 6).

use crate::settings::WindowSettings;
use crate::state::TrackerState;
use nalgebra::Vector3;
use tessera_geometry::Pose;

/// One fixed pose of a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Member {
    /// A recent frame that is no keyframe: its place in the tracker's list.
    Recent(usize),
    /// A keyframe, by id.
    Keyframe(u32),
}

/// The last frame, the last keyframe, the oldest keyframe that sees the same, then the nearest.
///
/// `predicted`: `world_from_camera` of the new frame. `only_newest` leaves out all but the last
/// frame and the last keyframe (a second solve without old poses, SPEC 7).
pub(crate) fn select(
    state: &TrackerState,
    settings: &WindowSettings,
    predicted: &Pose,
    oldest_allowed: u32,
) -> Vec<Member> {
    let size = settings.size as usize;
    let mut members = Vec::with_capacity(size);
    // The last keyframe of an earlier run may be anywhere: it takes part where it is near.
    let last_keyframe = state.last_own_keyframe();
    if let Some((place, recent)) = state.recent.iter().enumerate().next_back()
        && last_keyframe.is_none_or(|k| k.frame_index != recent.index)
        && recent.state == crate::records::State::Tracking
    {
        members.push(Member::Recent(place));
    }
    let mut near = near(state, settings, predicted);
    if let Some(last_keyframe) = last_keyframe
        && members.len() < size
    {
        members.push(Member::Keyframe(last_keyframe.id));
    }
    near.retain(|n| last_keyframe.is_none_or(|k| n.1 != k.id) && n.1 >= oldest_allowed);
    if let Some(oldest) = near.iter().map(|n| n.1).min()
        && members.len() < size
    {
        members.push(Member::Keyframe(oldest));
        near.retain(|n| n.1 != oldest);
    }
    members.extend(near.iter().take(size.saturating_sub(members.len())).map(|n| Member::Keyframe(n.1)));
    members
}

/// Keyframes within the window's limits of a view, nearest first, by distance and angle together.
pub(crate) fn near(state: &TrackerState, settings: &WindowSettings, view: &Pose) -> Vec<(f64, u32)> {
    let radius_sq = settings.radius_m * settings.radius_m;
    let angle_limit = settings.angle_deg.to_radians();
    let centre = view.translation.vector;
    let mut near: Vec<(f64, u32)> = state
        .keyframes
        .iter()
        .filter(|k| k.is_active())
        // Most keyframes of a long run are far away: that must cost nothing.
        .filter(|k| (Vector3::from(k.world_from_camera.translation_m) - centre).norm_squared() <= radius_sq)
        .filter_map(|k| {
            let (distance_m, angle_rad) = view_difference(&Pose::from(&k.world_from_camera), view);
            (angle_rad <= angle_limit)
                .then(|| (distance_m / settings.radius_m.max(1e-9) + angle_rad / angle_limit.max(1e-9), k.id))
        })
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near
}

/// Distance of the camera centres in metres and angle between the optical axes in radians.
pub(crate) fn view_difference(a: &Pose, b: &Pose) -> (f64, f64) {
    let distance_m = (a.translation.vector - b.translation.vector).norm();
    (distance_m, angle_between(&optical_axis(a), &optical_axis(b)))
}

/// Where the camera looks, a unit vector in the world.
pub(crate) fn optical_axis(world_from_camera: &Pose) -> Vector3<f64> {
    world_from_camera.rotation * Vector3::z()
}

/// Angle between two unit vectors, radians.
pub(crate) fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::acos(a.dot(b).clamp(-1.0, 1.0))
}
