//! Covisibility by pose: which keyframes share multi-edges in the global optimisation (method 8.1).

use crate::loops::view_limits::{ViewLimits, optical_axis};
use crate::map::submaps::Origin;
use crate::settings::GlobalSettings;
use nalgebra::Vector3;
use rayon::prelude::*;
use tessera_geometry::Pose;

/// Index gap that counts as large.
const FAR_GAP: usize = 10;

/// Pairs `(newer, older)`, sorted by the older: consecutive keyframes, and for each keyframe its neighbours,
/// half of them nearest in pose and half nearest among those far away in index (nearest alone
/// picks neighbours in time). Where another run or another submap goes on, consecutive keyframes may be
/// anywhere, and poses of different components are in different frames.
pub fn pairs(poses: &[Pose], origins: &[Origin]) -> Vec<(usize, usize)> {
    let axes: Vec<Vector3<f64>> = poses.iter().map(optical_axis).collect();
    let of_each = (0..poses.len()).into_par_iter().with_min_len(16);
    let mut found: Vec<(usize, usize)> =
        of_each.flat_map_iter(|i| of_one(i, poses, &axes, origins)).collect();
    // By target first: its surface then stays in the cache for all its pairs.
    found.sort_unstable_by_key(|&(newer, older)| (older, newer));
    found.dedup();
    found
}

/// The pairs that one keyframe asks for.
fn of_one(i: usize, poses: &[Pose], axes: &[Vector3<f64>], origins: &[Origin]) -> Vec<(usize, usize)> {
    let limits =
        ViewLimits { radius_m: GlobalSettings::RADIUS_M, angle_rad: GlobalSettings::ANGLE_DEG.to_radians() };
    let half = GlobalSettings::NEIGHBOURS.div_ceil(2);
    let others = (0..poses.len())
        .filter(|&j| j != i && origins[j].component == origins[i].component)
        .map(|j| (j, poses[j].translation.vector));
    let near = limits.nearest(&poses[i].translation.vector, &axes[i], others, |j| axes[j]);
    let nearest = near.iter().take(half);
    let far = near.iter().skip(half).filter(|n| n.1.abs_diff(i) >= FAR_GAP).take(half);
    let before = (i > 0 && origins[i] == origins[i - 1]).then(|| (i, i - 1));
    before.into_iter().chain(nearest.chain(far).map(|&(_, j)| (i.max(j), i.min(j)))).collect()
}
