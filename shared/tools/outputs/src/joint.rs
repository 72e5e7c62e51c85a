//! One cloud of keyframes of several runs.

use crate::ToolError;
use crate::map::{self, MapInput};
use crate::preview::few;
use crate::voxels::{MapPoint, VoxelCloud};
use std::path::Path;
use tessera_geometry::{Camera, Pose};
use tessera_settings::OutputSettings;
use tessera_slam::{KeyframeState, KeyframeSurfaces};

/// Writes a cloud of these keyframes, which have one gauge, as `name` in `folder`: one point a voxel, as in a
/// run's own `map.ply`. Each with the camera that saw it, and the pixels between neighbouring vertices.
///
/// # Errors
/// Names the file that cannot be written.
pub fn write_joint_map<'k>(
    (folder, name): (&Path, &str),
    settings: &OutputSettings,
    keyframes: impl Iterator<Item = (&'k KeyframeState, (&'k Camera, usize))>,
    surfaces: &dyn KeyframeSurfaces,
) -> Result<JointCloud, ToolError> {
    let mut cloud = VoxelCloud::new(settings.map_voxel_m);
    for (keyframe, (camera, step)) in keyframes {
        let input = MapInput { camera, step, settings, warp: None };
        let world_from_camera = Pose::from(&keyframe.world_from_camera);
        let seen = (keyframe.id, surfaces.vertices(keyframe.id));
        map::add_keyframe(&mut cloud, &input, seen, &world_from_camera, keyframe.velocity);
    }
    map::write(&cloud, &folder.join(name))?;
    Ok(JointCloud(cloud))
}

/// A cloud that was written, for [`joint_preview`].
pub struct JointCloud(VoxelCloud);

/// Clouds in at most `most` points: the edge of the voxels that these are means of, and the points of each.
pub fn joint_preview(
    clouds: Vec<JointCloud>,
    settings: &OutputSettings,
    most: usize,
) -> (f64, Vec<Vec<MapPoint>>) {
    let clouds = clouds.into_iter().map(|cloud| cloud.0).collect();
    let (voxel_m, clouds) = few(clouds, settings.map_voxel_m, most);
    (voxel_m, clouds.iter().map(|cloud| cloud.points().collect()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run;
    use tessera_geometry::PoseBits;
    use tessera_slam::StoreSlot;
    use tessera_surface::Vertex;

    struct Surfaces(Vec<Vec<Vertex>>);

    impl KeyframeSurfaces for Surfaces {
        fn vertices(&self, keyframe: u32) -> &[Vertex] {
            &self.0[keyframe as usize]
        }
    }

    #[test]
    fn keyframes_of_all_runs_stand_in_one_cloud() {
        let dir = tempfile::tempdir().unwrap();
        let keyframe = |id: u32, x_m: f64| KeyframeState {
            id,
            session: id,
            submap: id,
            frame_index: 0,
            stamp_nanos: 0,
            world_from_camera: PoseBits::from(&Pose::translation(x_m, 0.0, 0.0)),
            velocity: [0.0; 6],
            slot: StoreSlot::default(),
            edges: Vec::new(),
            covariance: Vec::new(),
            up: None,
            place: Vec::new(),
            alike: Vec::new(),
            anchored_to: None,
        };
        let keyframes = [keyframe(0, 0.0), keyframe(1, 1.0)];
        let surfaces = Surfaces((0..2).map(test_run::surface).collect());
        let (camera, settings) = (test_run::camera(), OutputSettings::default());
        let place = (dir.path(), "map.ply");
        let seen = keyframes.iter().map(|keyframe| (keyframe, (&camera, 4)));
        write_joint_map(place, &settings, seen, &surfaces).unwrap();
        let bytes = std::fs::read(dir.path().join("map.ply")).unwrap();
        assert!(bytes.starts_with(b"ply\nformat binary_little_endian 1.0\nelement vertex 2\n"));
    }
}
