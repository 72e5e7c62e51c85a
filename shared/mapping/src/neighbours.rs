//! Which keyframes share multi-edges in the global optimisation (SPEC 8).

use crate::settings::GlobalSettings;
use crate::window::view_difference;
use tessera_geometry::Pose;

/// Index gap that counts as large.
const FAR_GAP: usize = 10;

/// Pairs `(newer, older)`, sorted by the older: consecutive keyframes, and for each keyframe its neighbours,
/// half of them nearest in pose and half nearest among those far away in index (nearest alone
/// picks neighbours in time). `sessions`: the run that made each; where another run goes on,
/// consecutive keyframes may be anywhere.
pub fn pairs(poses: &[Pose], sessions: &[u32], settings: &GlobalSettings) -> Vec<(usize, usize)> {
    let angle_limit = settings.angle_deg.to_radians();
    let half = (settings.neighbours as usize).div_ceil(2);
    let mut found = Vec::new();
    for i in 0..poses.len() {
        if i > 0 && sessions[i] == sessions[i - 1] {
            found.push((i, i - 1));
        }
        let mut near: Vec<(f64, usize)> = (0..poses.len())
            .filter(|&j| j != i)
            .filter_map(|j| {
                let apart_m = (poses[i].translation.vector - poses[j].translation.vector).norm();
                if apart_m > settings.radius_m {
                    return None;
                }
                let (_, angle_rad) = view_difference(&poses[i], &poses[j]);
                (angle_rad <= angle_limit).then(|| (apart_m / settings.radius_m + angle_rad / angle_limit, j))
            })
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let nearest = near.iter().take(half);
        let far = near.iter().skip(half).filter(|n| n.1.abs_diff(i) >= FAR_GAP).take(half);
        found.extend(nearest.chain(far).map(|&(_, j)| (i.max(j), i.min(j))));
    }
    // By target first: its surface then stays in the cache for all its pairs.
    found.sort_unstable_by_key(|&(newer, older)| (older, newer));
    found.dedup();
    found
}
