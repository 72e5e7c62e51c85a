//! Covisibility by pose: which keyframes share multi-edges in the global optimisation (method 8.1).

use crate::map::submaps::Origin;
use crate::map::view_limits::{ViewLimits, optical_axis, take_nearest};
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
    let views = Views::new(poses);
    let of_each = (0..poses.len()).into_par_iter().with_min_len(16);
    let mut found: Vec<(usize, usize)> = of_each.flat_map_iter(|i| of_one(i, &views, origins)).collect();
    // By target first: its surface then stays in the cache for all its pairs.
    found.sort_unstable_by_key(|&(newer, older)| (older, newer));
    found.dedup();
    found
}

/// All views, and which of them are in each cube of space as wide as neighbours reach: a keyframe looks at
/// what is around it, however long the way.
struct Views {
    centres: Vec<Vector3<f64>>,
    axes: Vec<Vector3<f64>>,
    /// Cube and place of each view, sorted.
    in_cubes: Vec<([i64; 3], usize)>,
}

impl Views {
    fn new(poses: &[Pose]) -> Self {
        let centres: Vec<Vector3<f64>> = poses.iter().map(|pose| pose.translation.vector).collect();
        let mut in_cubes: Vec<_> = centres.iter().map(cube).zip(0..).collect();
        in_cubes.sort_unstable();
        Self { centres, axes: poses.iter().map(optical_axis).collect(), in_cubes }
    }

    /// The views in the cube of one and in those around it.
    fn around(&self, i: usize) -> impl Iterator<Item = usize> {
        let [x, y, z] = cube(&self.centres[i]);
        let columns = (-1..=1).flat_map(move |dx| (-1..=1).map(move |dy| (x + dx, y + dy)));
        columns.flat_map(move |(x, y)| {
            let from = self.in_cubes.partition_point(|(cube, _)| *cube < [x, y, z - 1]);
            let rest = &self.in_cubes[from..];
            rest.iter().take_while(move |(cube, _)| *cube <= [x, y, z + 1]).map(|&(_, j)| j)
        })
    }
}

fn cube(centre: &Vector3<f64>) -> [i64; 3] {
    // What is not finite has no neighbours anyway.
    [0, 1, 2].map(|k| ((centre[k] / CUBE_M).floor() as i64).clamp(-MOST_CUBES, MOST_CUBES))
}

/// Edge of a cube, metres: a little more than neighbours reach, whatever is rounded.
const CUBE_M: f64 = 1.001 * GlobalSettings::RADIUS_M;

/// Cubes in one direction: what is farther away is in the last one.
const MOST_CUBES: i64 = 1 << 40;

/// The pairs that one keyframe asks for.
fn of_one(i: usize, views: &Views, origins: &[Origin]) -> Vec<(usize, usize)> {
    let limits =
        ViewLimits { radius_m: GlobalSettings::RADIUS_M, angle_rad: GlobalSettings::ANGLE_DEG.to_radians() };
    let half = GlobalSettings::NEIGHBOURS.div_ceil(2);
    let Views { centres, axes, .. } = views;
    let others = views
        .around(i)
        .filter(|&j| j != i && origins[j].component == origins[i].component)
        .map(|j| (j, centres[j]));
    let mut near = limits.within(&centres[i], &axes[i], others, |j| axes[j]);
    let nearest = take_nearest(&mut near, half);
    near.retain(|n| n.1.abs_diff(i) >= FAR_GAP);
    let far = take_nearest(&mut near, half);
    let before = (i > 0 && origins[i] == origins[i - 1]).then(|| (i, i - 1));
    let both = nearest.iter().chain(&far).map(|&(_, j)| (i.max(j), i.min(j)));
    before.into_iter().chain(both).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::{Twist, exp};
    use tessera_numerics::SplitMix64;

    /// The pairs by looking at all views, in the order of their scores.
    fn by_all(poses: &[Pose], origins: &[Origin]) -> Vec<(usize, usize)> {
        let limits = ViewLimits {
            radius_m: GlobalSettings::RADIUS_M,
            angle_rad: GlobalSettings::ANGLE_DEG.to_radians(),
        };
        let half = GlobalSettings::NEIGHBOURS.div_ceil(2);
        let mut found = Vec::new();
        for i in 0..poses.len() {
            let others = (0..poses.len())
                .filter(|&j| j != i && origins[j].component == origins[i].component)
                .map(|j| (j, poses[j].translation.vector));
            let (centre, axis) = (poses[i].translation.vector, optical_axis(&poses[i]));
            let near = limits.nearest(&centre, &axis, others, |j| optical_axis(&poses[j]));
            let far = near.iter().skip(half).filter(|n| n.1.abs_diff(i) >= FAR_GAP).take(half);
            found.extend(near.iter().take(half).chain(far).map(|n| (i.max(n.1), i.min(n.1))));
            found.extend((i > 0 && origins[i] == origins[i - 1]).then(|| (i, i - 1)));
        }
        found.sort_unstable_by_key(|&(newer, older)| (older, newer));
        found.dedup();
        found
    }

    #[test]
    fn the_views_around_one_give_the_pairs_that_all_give() {
        let mut random = SplitMix64::for_frame(7, 7);
        let mut uniform = || random.next_u64() as f64 / u64::MAX as f64 * 2.0 - 1.0;
        let mut poses: Vec<Pose> = (0..300)
            .map(|_| {
                let mut three = |size: f64| Vector3::new(uniform(), uniform(), uniform()) * size;
                let turn = exp(&Twist { rho: Vector3::zeros(), phi: three(0.6) });
                Pose::from_parts(three(3.0).into(), turn.rotation)
            })
            .collect();
        // The same view again and again, as in a round: the first among equals comes first.
        (0..60).for_each(|k| poses.push(poses[k % 7]));
        poses.push(Pose::translation(1e300, 0.0, 0.0));
        poses.push(Pose::translation(f64::NAN, 0.0, 0.0));
        let origin = |k: usize| Origin { session: 0, submap: 0, component: u32::from(k.is_multiple_of(5)) };
        let origins: Vec<Origin> = (0..poses.len()).map(origin).collect();
        let found = pairs(&poses, &origins);
        assert!(found.len() > 1000);
        assert_eq!(found, by_all(&poses, &origins));
        assert_eq!(pairs(&[], &[]), []);
    }
}
