//! Covisibility by pose: which keyframes share multi-edges in the global optimisation (method 8.1).

use crate::map::newest_blocks::N_FREE;
use crate::map::submaps::Origin;
use crate::map::view_limits::{Nearest, ViewLimits, optical_axis};
use crate::settings::GlobalSettings;
use nalgebra::Vector3;
use rayon::prelude::*;
use tessera_geometry::Pose;

/// Views that may share surfaces.
pub(crate) const LIMITS: ViewLimits =
    ViewLimits { radius_m: GlobalSettings::RADIUS_M, angle_rad: GlobalSettings::ANGLE_DEG.to_radians() };

/// Pairs `(newer, older)`, sorted by the older: consecutive keyframes, and for each keyframe its neighbours,
/// half of them nearest in pose and half nearest among those far away in index (nearest alone
/// picks neighbours in time). Where another run or another submap goes on, consecutive keyframes may be
/// anywhere, and poses of different components are in different frames.
///
/// Pairs that are `kept` from before give way only to nearer ones, so that motion of millimetres changes nothing.
pub fn pairs(poses: &[Pose], origins: &[Origin], kept: &[(usize, usize)]) -> Vec<(usize, usize)> {
    let (views, kept) = (Views::new(poses, origins), KeptPairs::new(poses.len(), kept));
    let of_each = views.0.par_iter().with_min_len(16);
    let found = of_each.flat_map_iter(|view| of_one(view, (&views, origins), &kept));
    let mut found: Vec<(usize, usize)> = found.collect();
    // By target first: its surface then stays in the cache for all its pairs.
    found.par_sort_unstable_by_key(|&(newer, older)| (older, newer));
    found.dedup();
    found
}

/// All views, sorted by the cube of space that they are in, as wide as neighbours reach: a keyframe looks at what is
/// around it, however long the way.
struct Views(Vec<PosedView>);

/// One keyframe's view.
#[derive(Clone, Copy)]
struct PosedView {
    cube: [i64; 3],
    /// Place of the keyframe.
    place: usize,
    centre: Vector3<f64>,
    axis: Vector3<f64>,
    component: u32,
}

impl Views {
    fn new(poses: &[Pose], origins: &[Origin]) -> Self {
        let view = |(place, pose): (usize, &Pose)| {
            let (centre, component) = (pose.translation.vector, origins[place].component);
            PosedView { cube: cube(&centre), place, centre, axis: optical_axis(pose), component }
        };
        let mut views: Vec<PosedView> = poses.iter().enumerate().map(view).collect();
        views.sort_unstable_by_key(|view| (view.cube, view.place));
        Self(views)
    }

    /// The views in the cube of one and in those around it, column by column.
    fn around(&self, view: &PosedView) -> impl Iterator<Item = &[PosedView]> {
        let [x, y, z] = view.cube;
        // Its own first: the nearest are there.
        let columns = [0, -1, 1].into_iter().flat_map(move |dx| [0, -1, 1].map(move |dy| (x + dx, y + dy)));
        columns.map(move |(x, y)| {
            let from = self.0.partition_point(|view| view.cube < [x, y, z - 1]);
            let rest = &self.0[from..];
            &rest[..rest.partition_point(|view| view.cube <= [x, y, z + 1])]
        })
    }
}

fn cube(centre: &Vector3<f64>) -> [i64; 3] {
    // What is farther away than an i32 counts, or not finite, has no neighbours anyway.
    [0, 1, 2].map(|k| i64::from((centre[k] / GlobalSettings::RADIUS_M).floor() as i32))
}

/// Pairs that are kept from before: the older keyframes of each newer one, rising.
struct KeptPairs {
    older: Vec<usize>,
    /// Those of keyframe `k` at `starts[k]..starts[k + 1]`.
    starts: Vec<usize>,
}

impl KeptPairs {
    /// Pairs among `n` keyframes.
    fn new(n: usize, pairs: &[(usize, usize)]) -> Self {
        let mut pairs = pairs.to_vec();
        pairs.sort_unstable();
        let mut starts = vec![0; n + 1];
        pairs.iter().for_each(|(newer, _)| starts[newer + 1] += 1);
        (0..n).for_each(|k| starts[k + 1] += starts[k]);
        Self { older: pairs.into_iter().map(|(_, older)| older).collect(), starts }
    }

    fn has(&self, a: usize, b: usize) -> bool {
        let (newer, older) = (a.max(b), a.min(b));
        self.older[self.starts[newer]..self.starts[newer + 1]].binary_search(&older).is_ok()
    }
}

/// The pairs that one keyframe asks for.
fn of_one(
    view: &PosedView,
    (views, origins): (&Views, &[Origin]),
    kept: &KeptPairs,
) -> impl Iterator<Item = (usize, usize)> + use<> {
    let limits = LIMITS;
    let half = GlobalSettings::NEIGHBOURS.div_ceil(2);
    // By as much as drift may have moved a pair: what takes the place of a kept neighbour is nearer by more.
    let lead = GlobalSettings::FIRST_DISTANCE_M / GlobalSettings::RADIUS_M;
    let (i, least_dot) = (view.place, limits.least_dot());
    // Half of those far away may be among the nearest of all.
    let (mut nearest, mut far) = (Nearest::new(half), Nearest::new(2 * half));
    for other in views.around(view).flatten() {
        let apart_sq = (other.centre - view.centre).norm_squared();
        let (dot, is_far) = (other.axis.dot(&view.axis), other.place.abs_diff(i) >= N_FREE as usize);
        let is_near = apart_sq <= limits.radius_m * limits.radius_m && dot >= least_dot;
        if !is_near || other.place == i || other.component != view.component {
            continue;
        }
        // Most are farther than as many that were looked at, which takes no arc cosine to tell.
        let least = limits.least_score(apart_sq, dot) - lead;
        if !(nearest.admits(least) || is_far && far.admits(least)) {
            continue;
        }
        let Some(score) = limits.score(apart_sq, dot) else { continue };
        let score = score - f64::from(u8::from(kept.has(i, other.place))) * lead;
        nearest.offer(score, other.place);
        if is_far {
            far.offer(score, other.place);
        }
    }
    let nearest: Vec<usize> = nearest.names().copied().collect();
    let others: Vec<usize> = far.names().copied().filter(|j| !nearest.contains(j)).take(half).collect();
    let before = (i > 0 && origins[i] == origins[i - 1]).then(|| (i, i - 1));
    before.into_iter().chain(nearest.into_iter().chain(others).map(move |j| (i.max(j), i.min(j))))
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
            let far = near.iter().skip(half).filter(|n| n.1.abs_diff(i) >= N_FREE as usize).take(half);
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
        let found = pairs(&poses, &origins, &[]);
        assert!(found.len() > 1000);
        assert_eq!(found, by_all(&poses, &origins));
        assert_eq!(pairs(&[], &[], &[]), []);
    }

    #[test]
    fn kept_neighbours_give_way_to_much_nearer_ones_alone() {
        let at = |x_m: f64| Pose::translation(x_m, 0.0, 0.0);
        // As many neighbours as there may be, a group with its own, one at the side, one far away, and the keyframe.
        let poses = |side_m: f64| -> Vec<Pose> {
            let row = (0..12).map(|k| at(0.5 + 1e-3 * f64::from(k)));
            let group = (0..6).map(|k| at(-0.7 - 1e-3 * f64::from(k)));
            row.chain(group).chain([at(-side_m), at(1.2), at(0.0)]).collect()
        };
        let origins = vec![Origin { session: 0, submap: 0, component: 0 }; 21];
        let of_last = |side_m: f64, kept: &[(usize, usize)]| -> Vec<usize> {
            let found = pairs(&poses(side_m), &origins, kept);
            found.iter().filter(|pair| pair.0 == 20).map(|pair| pair.1).collect()
        };
        let before = pairs(&poses(0.6), &origins, &[]);
        assert_eq!(of_last(0.499, &before), of_last(0.6, &[]), "a millimetre");
        assert!(of_last(0.499, &[]).contains(&18) && !of_last(0.6, &[]).contains(&18));
        assert!(of_last(0.3, &before).contains(&18), "twenty centimetres");
    }
}
