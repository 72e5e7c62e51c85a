//! Minimal samples and the poses that they ask for.

use super::align::align_triangles;
use super::correspondence::{Correspondence, PointEstimate};
use super::p3p;
use super::refine::polish;
use nalgebra::Vector3;
use tessera_geometry::Pose;
use tessera_numerics::SplitMix64;

/// Correspondences by what they know, as indices.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pools {
    /// Points on both sides.
    both: Vec<u32>,
    /// A point in the query's camera.
    query: Vec<u32>,
    /// A point in the target's camera.
    target: Vec<u32>,
    /// Any point.
    n_usable: usize,
}

impl Pools {
    pub(crate) fn fill(&mut self, correspondences: &[Correspondence]) {
        self.both.clear();
        self.query.clear();
        self.target.clear();
        self.n_usable = 0;
        for (index, c) in correspondences.iter().enumerate() {
            let (query, target) = (c.query.point.is_some(), c.target.point.is_some());
            let pools =
                [(&mut self.both, query && target), (&mut self.query, query), (&mut self.target, target)];
            for (pool, belongs) in pools {
                if belongs {
                    pool.push(index as u32);
                }
            }
            self.n_usable += usize::from(query || target);
        }
    }

    /// Correspondences with a point on any side.
    pub(crate) fn n_usable(&self) -> usize {
        self.n_usable
    }

    /// Poses of one random sample: of three correspondences with both points where there are such,
    /// three of four times; else of points and bearings.
    pub(crate) fn draw(
        &self,
        iteration: u32,
        correspondences: &[Correspondence],
        random: &mut SplitMix64,
        poses: &mut Vec<Pose>,
    ) {
        poses.clear();
        let one_sided = if self.query.len() >= self.target.len() { &self.query } else { &self.target };
        let has_more = one_sided.len() > self.both.len();
        if self.both.len() >= 3 && !(has_more && iteration % 4 == 3) {
            let Some(sample) = three(&self.both, random) else { return };
            let sample = sample.map(|i| &correspondences[i]);
            poses.extend(from_points(&sample));
        } else if let Some(sample) = three(one_sided, random) {
            let sample = sample.map(|i| &correspondences[i]);
            from_bearings(&sample, self.query.len() >= self.target.len(), poses);
        }
    }
}

/// Three different indices.
fn three(pool: &[u32], random: &mut SplitMix64) -> Option<[usize; 3]> {
    let n = pool.len();
    if n < 3 {
        return None;
    }
    let (a, mut b, mut c) = (random.below(n), random.below(n - 1), random.below(n - 2));
    b += usize::from(b >= a);
    let (low, high) = (a.min(b), a.max(b));
    c += usize::from(c >= low);
    c += usize::from(c >= high);
    Some([a, b, c].map(|i| pool[i] as usize))
}

fn positions(points: [&Option<PointEstimate>; 3]) -> Option<[Vector3<f64>; 3]> {
    let [a, b, c] = points.map(|point| point.as_ref().map(|point| point.position_m));
    Some([a?, b?, c?])
}

/// 3D-3D.
fn from_points(sample: &[&Correspondence; 3]) -> Option<Pose> {
    let query = positions(sample.map(|c| &c.query.point))?;
    let target = positions(sample.map(|c| &c.target.point))?;
    polish(sample, &align_triangles(&query, &target)?, 2)
}

/// 2D-3D: points of one camera seen by the other.
fn from_bearings(sample: &[&Correspondence; 3], points_of_query: bool, poses: &mut Vec<Pose>) {
    let observed =
        sample.map(|c| if points_of_query { (&c.query, &c.target) } else { (&c.target, &c.query) });
    let Some(points) = positions(observed.map(|(with_point, _)| &with_point.point)) else { return };
    let bearings = observed.map(|(_, seen)| seen.bearing());
    for distances in p3p::solve(&bearings, &points).into_iter().flatten() {
        let seen: [Vector3<f64>; 3] = std::array::from_fn(|k| bearings[k] * distances[k]);
        let aligned =
            if points_of_query { align_triangles(&points, &seen) } else { align_triangles(&seen, &points) };
        poses.extend(aligned);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_different_and_reach_all() {
        let pool: Vec<u32> = (10..15).collect();
        let mut random = SplitMix64::new(1);
        let mut seen = [0; 5];
        for _ in 0..500 {
            let [a, b, c] = three(&pool, &mut random).unwrap();
            assert!(a != b && b != c && a != c);
            [a, b, c].iter().for_each(|i| seen[i - 10] += 1);
        }
        assert!(seen.iter().all(|&n| (240..=360).contains(&n)), "{seen:?}");
        assert_eq!(three(&pool[..2], &mut random), None);
    }
}
