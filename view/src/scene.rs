//! What Rerun's data are made of: times, poses, colours.

use crate::error::ViewError;
use re_sdk::{AsComponents, RecordingStream};
use re_sdk_types::archetypes::Transform3D;
use re_sdk_types::components::Color;
use re_sdk_types::datatypes::Quaternion;
use tessera_geometry::{Pose, PoseBits};
use tessera_surface::Vertex;

/// Grey of what is not worth a colour.
pub(crate) const GREY: [u8; 3] = [130, 130, 130];
/// Blue, green, orange and vermilion of Okabe and Ito, told apart by everybody.
pub(crate) const BLUE: [u8; 3] = [0, 114, 178];
pub(crate) const GREEN: [u8; 3] = [0, 158, 115];
pub(crate) const ORANGE: [u8; 3] = [230, 159, 0];
pub(crate) const VERMILION: [u8; 3] = [213, 94, 0];

/// Logs below one path at the present time.
pub(crate) fn log(
    recording: &RecordingStream,
    path: &str,
    what: &(impl AsComponents + ?Sized),
) -> Result<(), ViewError> {
    recording.log(path, what).map_err(ViewError::output)
}

/// Sets the time of what is logged next: the frame's index and stamp.
pub(crate) fn set_time(recording: &RecordingStream, frame: u64, seconds: f64) {
    recording.set_time_sequence("frame", i64::try_from(frame).unwrap_or(i64::MAX));
    recording.set_duration_secs("time", seconds);
}

/// A pose as Rerun has it.
pub(crate) fn transform(parent_from_child: &Pose) -> Transform3D {
    let PoseBits { translation_m, rotation_xyzw } = PoseBits::from(parent_from_child);
    Transform3D::from_translation_rotation(
        translation_m.map(|metres| metres as f32),
        Quaternion::from_xyzw(rotation_xyzw.map(|part| part as f32)),
    )
}

/// A colour as Rerun has it.
pub(crate) fn colour([r, g, b]: [u8; 3]) -> Color {
    Color::from_rgb(r, g, b)
}

/// Where a pose stands.
pub(crate) fn place(world_from_camera: &Pose) -> [f32; 3] {
    PoseBits::from(world_from_camera).translation_m.map(|metres| metres as f32)
}

/// Usable points of a surface in the camera's axes, with their colours; at most so many, spread
/// evenly over the grid.
pub(crate) fn points(vertices: &[Vertex], most: usize) -> (Vec<[f32; 3]>, Vec<Color>) {
    let valid: Vec<&Vertex> = vertices.iter().filter(|vertex| vertex.is_valid()).collect();
    let every = valid.len().div_ceil(most.max(1)).max(1);
    valid.into_iter().step_by(every).map(|vertex| (vertex.position, colour(vertex.rgb()))).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_usable_ones_and_no_more_than_asked_for() {
        let mut vertices = vec![Vertex { flags_rgb: Vertex::VALID, ..Vertex::default() }; 1000];
        vertices[3].flags_rgb = 0;
        assert_eq!(points(&vertices, 4000).0.len(), 999);
        let few = points(&vertices, 300);
        assert!(few.0.len() <= 300 && few.0.len() > 200 && few.0.len() == few.1.len());
        assert!(points(&[], 10).0.is_empty());
    }
}
