//! Selection of keyframe pairs: those that see the same from far apart.

use tessera_geometry::{Pose, log};

/// Pairs nearer than this share of the limits are weak evidence: what a sensor does wrong in the same
/// pixels of both frames, it does twice, and it pulls the two poses together as a larger focal
/// length would.
const LEAST_SHARE: f64 = 0.3;

/// How far apart keyframes may be, and how many are compared with each.
#[derive(Clone, Copy, Debug)]
pub struct PairLimits {
    /// Distance of the camera centres, metres.
    pub distance_m: f64,
    /// Relative rotation, radians.
    pub angle_rad: f64,
    /// Partners of a keyframe, at most.
    pub neighbours: usize,
}

/// Pairs `(newer, older)`, sorted by the older: consecutive keyframes, and for each keyframe
/// partners that are spread evenly over the distances within the limits. `sessions`: the run that
/// made each keyframe; where another run goes on, consecutive keyframes may be anywhere.
pub fn pairs(poses: &[Pose], sessions: &[u32], limits: &PairLimits) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for i in 0..poses.len() {
        if i > 0 && sessions[i] == sessions[i - 1] {
            found.push((i, i - 1));
        }
        let mut partners: Vec<(f64, usize)> = (0..poses.len())
            .filter(|&j| j != i)
            .map(|j| (share_of_limits(&poses[i], &poses[j], limits), j))
            .filter(|(share, _)| *share <= 1.0)
            .collect();
        partners.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let n_near = partners.partition_point(|(share, _)| *share < LEAST_SHARE);
        // Where nearly all is near, the farthest of it has to do.
        let n_left_out = n_near.min(partners.len().saturating_sub(limits.neighbours / 2));
        let far = &partners[n_left_out..];
        let n = far.len().min(limits.neighbours);
        found.extend((0..n).map(|k| {
            let j = far[(2 * k + 1) * far.len() / (2 * n)].1;
            (i.max(j), i.min(j))
        }));
    }
    // By target first: its surface then stays in the cache for all its pairs.
    found.sort_unstable_by_key(|&(newer, older)| (older, newer));
    found.dedup();
    found
}

/// The larger of distance and turn, each as a share of its limit.
fn share_of_limits(a: &Pose, b: &Pose, limits: &PairLimits) -> f64 {
    let between = log(&(a.inverse() * b));
    let distance_m = (a.translation.vector - b.translation.vector).norm();
    (distance_m / limits.distance_m).max(between.phi.norm() / limits.angle_rad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use tessera_geometry::{Twist, exp};

    const LIMITS: PairLimits = PairLimits { distance_m: 1.0, angle_rad: 1.0, neighbours: 4 };

    fn on_a_line(n: usize, step_m: f64) -> Vec<Pose> {
        let at = |k: usize| Twist { rho: Vector3::new(step_m * k as f64, 0.0, 0.0), phi: Vector3::zeros() };
        (0..n).map(|k| exp(&at(k))).collect()
    }

    #[test]
    fn partners_are_far_apart_and_within_the_limits() {
        let poses = on_a_line(40, 0.05);
        let found = pairs(&poses, &[0; 40], &LIMITS);
        for &(newer, older) in found.iter().filter(|(newer, older)| newer - older > 1) {
            let distance_m = 0.05 * (newer - older) as f64;
            assert!((0.29..=1.01).contains(&distance_m), "{newer} {older}");
        }
        assert_eq!(found.iter().filter(|(newer, older)| newer - older == 1).count(), 39);
        assert!(found.iter().any(|(newer, older)| newer - older > 15), "{found:?}");
    }

    #[test]
    fn where_all_is_near_the_farthest_of_it_are_taken() {
        let found = pairs(&on_a_line(6, 0.01), &[0; 6], &LIMITS);
        assert!(found.contains(&(5, 0)), "{found:?}");
    }

    #[test]
    fn another_run_s_keyframe_is_no_neighbour_by_its_number() {
        let found = pairs(&on_a_line(2, 5.0), &[0, 1], &LIMITS);
        assert_eq!(found, []);
    }
}
