//! The map thinned to a number of points, for a page: each component of submaps by itself.

use crate::ToolError;
use crate::export::clouds;
use crate::replay::Replay;
use crate::voxels::{MapPoint, VoxelCloud};
use tessera_settings::Settings;
use tessera_stage::RunFiles;

/// Voxels are not made larger than this, metres.
const LARGEST_VOXEL_M: f64 = 1e6;

/// The map in few points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Preview {
    /// Edge of the voxels, metres: that of `map.ply` where it needs no thinning.
    pub voxel_m: f64,
    /// Each component of submaps, the main one first: its number, and its points in its own world frame.
    pub components: Vec<(u32, Vec<MapPoint>)>,
}

/// The map in at most `most` points: the mean of each voxel, whose edge grows until they are few enough. A
/// function of the run directory.
///
/// # Errors
/// Names the file that cannot be read.
pub fn preview(
    files: &RunFiles,
    replay: &Replay,
    settings: &Settings,
    most: usize,
) -> Result<Preview, ToolError> {
    let mut numbers = vec![replay.main_component()];
    numbers.extend(replay.apart().into_keys());
    let clouds = clouds(files, replay, settings, &numbers)?;
    let (voxel_m, clouds) = few(clouds, settings.output.map_voxel_m, most);
    let points = clouds.iter().map(|cloud| cloud.points().collect());
    Ok(Preview { voxel_m, components: numbers.into_iter().zip(points).collect() })
}

/// The clouds in voxels of one edge, so large that there are at most `most` points.
pub(crate) fn few(clouds: Vec<VoxelCloud>, edge_m: f64, most: usize) -> (f64, Vec<VoxelCloud>) {
    let n_points = |clouds: &[VoxelCloud]| clouds.iter().map(VoxelCloud::len).sum::<usize>();
    let mut n = n_points(&clouds);
    if n <= most {
        return (edge_m, clouds);
    }
    let (mut edge_m, mut thinned) = (edge_m, Vec::new());
    while n > most && edge_m < LARGEST_VOXEL_M {
        // Surfaces fill voxels with the inverse square of the edge.
        edge_m *= (n as f64 / most.max(1) as f64).sqrt().max(1.05);
        thinned = clouds.iter().map(|cloud| cloud.thinned(edge_m)).collect();
        n = n_points(&thinned);
    }
    (edge_m, thinned)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    /// A square plane of points, `n` along each side, 10 mm apart.
    fn plane(n: u32) -> VoxelCloud {
        let mut cloud = VoxelCloud::new(0.01);
        for (row, column) in (0..n).flat_map(|row| (0..n).map(move |column| (row, column))) {
            let position = Vector3::new(0.005 + 0.01 * f64::from(column), 0.005 + 0.01 * f64::from(row), 1.0);
            cloud.add(&MapPoint { position, normal: -Vector3::z(), rgb: [7; 3], keyframe: row });
        }
        cloud
    }

    #[test]
    fn clouds_keep_their_extents_in_few_points() {
        let (edge_m, clouds) = few(vec![plane(100), plane(20)], 0.01, 1000);
        let n: usize = clouds.iter().map(VoxelCloud::len).sum();
        assert!((300..=1000).contains(&n), "{n}");
        let largest = clouds[0].points().map(|point| point.position.x).fold(0.0, f64::max);
        assert!(largest > 0.995 - edge_m && largest <= 0.995, "{largest}");
        assert!(clouds[0].points().all(|point| point.rgb == [7; 3] && (point.position.z - 1.0).abs() < 1e-9));
    }

    #[test]
    fn a_small_cloud_stays_as_it_is_and_none_is_no_error() {
        let (edge_m, clouds) = few(vec![plane(10)], 0.01, 100);
        assert_eq!((edge_m, clouds[0].len()), (0.01, 100));
        assert!(few(Vec::new(), 0.01, 100).1.is_empty());
        assert_eq!(few(vec![plane(10), plane(10)], 0.01, 0).1.len(), 2);
    }
}
