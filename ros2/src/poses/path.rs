//! The way so far, bounded: once it is full, every second pose is forgotten.

use tessera_geometry::Pose;

/// Poses that are kept at most.
const MOST: usize = 2000;

/// Poses of the base in odom with their times, spread evenly over the run.
#[derive(Debug)]
pub(crate) struct PosePath {
    poses: Vec<(i64, Pose)>,
    /// Each so-many-th pose is kept.
    stride: u64,
    n_seen: u64,
}

impl Default for PosePath {
    fn default() -> Self {
        Self { poses: Vec::new(), stride: 1, n_seen: 0 }
    }
}

impl PosePath {
    pub(crate) fn add(&mut self, stamp_nanos: i64, odom_from_base: Pose) {
        let is_kept = self.n_seen.is_multiple_of(self.stride);
        self.n_seen += 1;
        if !is_kept {
            return;
        }
        if self.poses.len() == MOST {
            let mut at = 0;
            self.poses.retain(|_| {
                at += 1;
                at % 2 == 1
            });
            self.stride *= 2;
        }
        self.poses.push((stamp_nanos, odom_from_base));
    }

    pub(crate) fn poses(&self) -> &[(i64, Pose)] {
        &self.poses
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_is_bounded_and_even() {
        let mut way = PosePath::default();
        (0..10_000).for_each(|at| way.add(at, Pose::identity()));
        let stamps: Vec<i64> = way.poses().iter().map(|(stamp, _)| *stamp).collect();
        assert!(stamps.len() <= MOST && stamps.len() >= MOST / 2, "{}", stamps.len());
        assert_eq!((stamps[0], stamps[1]), (0, 8));
        assert!(stamps.windows(2).all(|pair| pair[1] - pair[0] == 8));
    }
}
