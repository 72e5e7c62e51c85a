//! `map.ply`: the keyframes' surfaces along the final trajectory, one point a voxel.

use crate::ToolError;
use crate::files::write_file;
use crate::ply::{PlyVertex, write_ply};
use crate::replay::Replay;
use crate::voxels::{MapPoint, VoxelCloud};
use nalgebra::Vector3;
use std::borrow::Cow;
use std::path::Path;
use tessera_calibration::SurfaceWarp;
use tessera_geometry::{Camera, Pose, RollingShutter, Twist, Vector6};
use tessera_settings::OutputSettings;
use tessera_surface::Vertex;

/// What the map is made of, beside the journal.
pub(crate) struct MapInput<'a> {
    /// The camera of the depth images.
    pub camera: &'a Camera,
    /// Pixels between neighbouring vertices.
    pub step: usize,
    /// How the map is thinned.
    pub settings: &'a OutputSettings,
    /// From the surfaces in the store to those of `camera`, where another camera made them.
    pub warp: Option<&'a SurfaceWarp>,
}

/// Gathers the vertices of the keyframes of one component of submaps; `vertices` gives their surfaces by
/// id.
///
/// # Errors
/// Those of `vertices`.
pub(crate) fn gather<'s, E>(
    (replay, component): (&Replay, u32),
    input: &MapInput<'_>,
    vertices: impl Fn(u32) -> Result<Cow<'s, [Vertex]>, E>,
) -> Result<VoxelCloud, E> {
    let mut cloud = VoxelCloud::new(input.settings.map_voxel_m);
    for (keyframe, world_from_camera) in replay.keyframes_of(component) {
        let stored = vertices(keyframe.id)?;
        let moved = input.warp.map(|warp| warp.apply(&stored));
        let seen = (keyframe.id, moved.as_deref().unwrap_or(&stored));
        add_keyframe(&mut cloud, input, seen, &world_from_camera, keyframe.velocity);
    }
    Ok(cloud)
}

pub(crate) fn add_keyframe(
    cloud: &mut VoxelCloud,
    input: &MapInput<'_>,
    (keyframe, vertices): (u32, &[Vertex]),
    world_from_camera: &Pose,
    velocity: [f64; 6],
) {
    let velocity = Twist::from_vector(&Vector6::from(velocity));
    let shutter = RollingShutter::new(input.camera, &velocity, input.step);
    let width = (input.camera.width as usize).div_ceil(input.step);
    for (row, line) in vertices.chunks(width).enumerate() {
        for vertex in line {
            let depth_m = f64::from(vertex.position[2]);
            if !vertex.is_valid() || !(depth_m <= input.settings.map_max_depth_m) {
                continue;
            }
            let image_row = row as f64 * input.step as f64 + f64::from(vertex.row_offset());
            let world_from_row = world_from_camera * shutter.stamp_from_row(image_row);
            let point_in_camera = Vector3::from(vertex.position.map(f64::from));
            cloud.add(&MapPoint {
                position: world_from_row.rotation * point_in_camera + world_from_row.translation.vector,
                normal: world_from_row.rotation * Vector3::from(vertex.normal.map(f64::from)),
                rgb: vertex.rgb(),
                keyframe,
            });
        }
    }
}

/// Writes the cloud as binary PLY; nothing in it depends on when or where it was written.
pub(crate) fn write(cloud: &VoxelCloud, path: &Path) -> Result<(), ToolError> {
    write_file(path, |writer| write_ply(cloud.len(), ply_vertices(cloud), &[], writer))
}

/// The points as they are written.
#[expect(clippy::cast_possible_truncation, reason = "to single precision, as the file has it")]
pub(crate) fn ply_vertices(cloud: &VoxelCloud) -> impl Iterator<Item = PlyVertex> {
    cloud.points().map(|point| PlyVertex {
        position: point.position.map(|v| v as f32).into(),
        normal: point.normal.map(|v| v as f32).into(),
        rgb: point.rgb,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run;
    use std::convert::Infallible;

    fn cloud() -> VoxelCloud {
        let (camera, settings) = (test_run::camera(), OutputSettings::default());
        let input = MapInput { camera: &camera, step: 4, settings: &settings, warp: None };
        let surfaces: Vec<Vec<Vertex>> = (0..3).map(test_run::surface).collect();
        let surface = |id| Ok::<_, Infallible>(Cow::Borrowed(&surfaces[id as usize][..]));
        let Ok(cloud) = gather((&test_run::replay(), 0), &input, surface);
        cloud
    }

    #[test]
    fn vertices_stand_where_their_keyframe_puts_them() {
        let points: Vec<MapPoint> = cloud().points().collect();
        // One valid vertex each, 2 m ahead of keyframes at x = 0, 1.2 and 1.4; others are invalid or far.
        let x: Vec<f64> = points.iter().map(|point| (point.position.x * 1e6).round() / 1e6).collect();
        assert_eq!(x, [0.0, 1.2, 1.4]);
        assert_eq!(points.iter().map(|point| point.keyframe).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!(points[0].rgb, [1, 2, 3]);
        assert_eq!(points[0].normal, -Vector3::z());
        // The first row is exposed 15 ms before the stamp, while the camera moves at 1 m/s along y.
        assert!((points[1].position.y - -0.014).abs() < 1e-3, "{}", points[1].position.y);
        assert_eq!(points[0].position.y, 0.0);
    }

    #[test]
    fn the_file_has_a_header_and_27_bytes_a_point() {
        let mut bytes = Vec::new();
        let cloud = cloud();
        write_ply(cloud.len(), ply_vertices(&cloud), &[], &mut bytes).unwrap();
        let marker = b"end_header\n";
        let end = bytes.windows(marker.len()).position(|window| window == marker).unwrap() + marker.len();
        assert!(bytes.starts_with(b"ply\nformat binary_little_endian 1.0\nelement vertex 3\n"));
        assert_eq!(bytes.len() - end, 3 * 27);
        assert_eq!(&bytes[end + 8..end + 12], 2.0f32.to_le_bytes());
        assert_eq!(&bytes[end + 24..end + 27], [1, 2, 3]);
    }
}
