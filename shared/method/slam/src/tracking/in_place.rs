//! Whether the camera is where the map of long ago has it: then no drift hides a loop from the poses.

use crate::map::detection;
use crate::map::state::KeyframeState;
use crate::pairs::keyframe_pair::MIN_FEATURES;
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::window_alignment::WindowAlignment;
use tessera_geometry::Pose;

/// Keyframes of the frame's window with which it closes a loop.
pub(crate) fn old_members<'a>(
    input: &TrackingInput<'a>,
    aligned: &WindowAlignment,
) -> impl Iterator<Item = &'a KeyframeState> {
    aligned
        .keyframes(input.map)
        .filter(|k| detection::is_loop(&input.context.mapping.loops, input.map, k, input.frame.index))
}

/// Whether features of a keyframe of long ago agree with the pose to which the window's surfaces brought the frame.
pub(crate) fn is_in_place(input: &TrackingInput<'_>, aligner: &Aligner, aligned: &WindowAlignment) -> bool {
    let world_from_camera = &aligned.alignment.world_from_camera;
    old_members(input, aligned).any(|old| {
        let at = Pose::from(&old.world_from_camera).inverse() * world_from_camera;
        aligner.sight.n_agreeing_with((true, u64::from(old.id)), &at) >= MIN_FEATURES as usize
    })
}
