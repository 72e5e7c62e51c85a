//! The local window: the fixed poses that a new frame is aligned to (III-F; method 6).

use crate::map::map_view::MapView;
use crate::map::view_limits::{ViewLimits, optical_axis};
use crate::settings::WindowSettings;
use nalgebra::Vector3;
use tessera_geometry::{Pose, Twist, Vector6};

/// One fixed pose of a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Member {
    /// A recent frame that is not a keyframe: its place in the tracker's list.
    Recent(usize),
    /// A keyframe, by id.
    Keyframe(u32),
}

/// Views that a window may hold.
pub(crate) const WINDOW_VIEWS: ViewLimits =
    ViewLimits { radius_m: WindowSettings::RADIUS_M, angle_rad: WindowSettings::ANGLE_DEG.to_radians() };

/// The last frame, the last keyframe, the oldest keyframe that sees the same, then the nearest.
///
/// `predicted`: `world_from_camera` of the new frame.
pub(crate) fn select(map: &MapView<'_>, settings: &WindowSettings, predicted: &Pose) -> Vec<Member> {
    let size = settings.size as usize;
    let mut members = Vec::with_capacity(size);
    // The last keyframe of an earlier run may be anywhere: it takes part where it is near.
    let last_keyframe = map.last_own_keyframe();
    if let Some((place, recent)) = map.state().recent.iter().enumerate().next_back()
        && last_keyframe.is_none_or(|k| k.frame_index != recent.index)
        && recent.state == crate::map::records::State::Tracking
    {
        members.push(Member::Recent(place));
    }
    let mut near = near(map, &WINDOW_VIEWS, predicted);
    if let Some(last_keyframe) = last_keyframe
        && members.len() < size
    {
        members.push(Member::Keyframe(last_keyframe.id));
    }
    near.retain(|n| last_keyframe.is_none_or(|k| n.1 != k.id));
    if let Some(oldest) = near.iter().map(|n| n.1).min()
        && members.len() < size
    {
        members.push(Member::Keyframe(oldest));
        near.retain(|n| n.1 != oldest);
    }
    members.extend(near.iter().take(size.saturating_sub(members.len())).map(|n| Member::Keyframe(n.1)));
    members
}

/// Active keyframes within the limits of a view, nearest first, each with its score.
pub(crate) fn near(map: &MapView<'_>, limits: &ViewLimits, view: &Pose) -> Vec<(f64, u32)> {
    let centres = map.active().map(|k| (k.id, Vector3::from(k.world_from_camera.translation_m)));
    let axis_of = |id: u32| {
        let pose = map.keyframe(id).map_or(Pose::identity(), |k| Pose::from(&k.world_from_camera));
        optical_axis(&pose)
    };
    limits.nearest(&view.translation.vector, &optical_axis(view), centres, axis_of)
}

/// The pose of a member and its motion per second in its camera frame, if it is still there.
pub(crate) fn pose_and_velocity(map: &MapView<'_>, member: &Member) -> Option<(Pose, Twist)> {
    let (pose, velocity) = match member {
        Member::Recent(place) => {
            map.state().recent.get(*place).map(|r| (&r.world_from_camera, &r.velocity))?
        }
        Member::Keyframe(id) => map.keyframe(*id).map(|k| (&k.world_from_camera, &k.velocity))?,
    };
    Some((Pose::from(pose), Twist::from_vector(&Vector6::from_column_slice(velocity))))
}
