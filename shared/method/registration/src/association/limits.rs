//! The limits of data association in one outer iteration (method 5.1, 10.3).

/// Steps of the descent in the first and in the last outer iteration, grid cells: far while the pose is
/// coarse.
const REACH: [f32; 2] = [4.0, 2.0];
/// Least cosine between the normals of a match in the first and in the last outer iteration: 45 and 30
/// degrees.
const NORMAL_COSINE: [f32; 2] = [0.707, 0.866];

/// Limits of one outer iteration.
#[derive(Clone, Copy, Debug)]
pub struct MatchLimits {
    /// Largest distance at the start of the schedule, metres.
    pub first_distance_m: f32,
    /// 0 in the first outer iteration, 1 in the last: distances shrink from `first_distance_m`
    /// to twice the local edge tolerance, radii and normals from their first to their last value.
    pub tightness: f32,
    /// Standard deviation that the error of the pose itself gives to a residual, metres; 0 where the
    /// pose is known as well as the surfaces are. While it is not, a match far from most
    /// matches is not an outlier: it may be the one thing that shows the error.
    pub pose_sigma_m: f32,
}

impl MatchLimits {
    /// The limits at a point of the schedule.
    pub fn new(first_distance_m: f64, tightness: f32) -> Self {
        Self { first_distance_m: first_distance_m as f32, tightness, pose_sigma_m: 0.0 }
    }

    /// The limits where drift may have carried the pose away by as much as `first_distance_m`: its
    /// error shrinks along the schedule, from a third of that to none.
    pub fn drifted(first_distance_m: f64, tightness: f32) -> Self {
        let pose_sigma_m = first_distance_m as f32 / 3.0 * (1.0 - tightness);
        Self { pose_sigma_m, ..Self::new(first_distance_m, tightness) }
    }

    /// The limits for one grid (method 5.1): distances from `tau_0` to `2 eps_d(z)`, reach and
    /// cosine from their first to their last value.
    pub(crate) fn at(&self, grid_step: usize) -> IterationLimits {
        let blend = |[first, last]: [f32; 2]| first + (last - first) * self.tightness;
        IterationLimits {
            reach: (blend(REACH) + 0.5) as u32,
            kept: Limits {
                distance_m: blend([self.first_distance_m, 0.0]),
                // 2 eps_d(z) = 2 * 2 n sigma(z), by eq. 4.
                distance_sigmas: blend([0.0, 4.0 * grid_step as f32]),
                cosine: blend(NORMAL_COSINE),
                pose_variance: self.pose_sigma_m * self.pose_sigma_m,
            },
            // A floor keeps perfect data from rejecting everything but the median itself.
            least_median: if self.pose_sigma_m > 0.0 { 1.0 } else { 0.05 },
        }
    }
}

/// The limits of one outer iteration for one grid.
#[derive(Clone, Copy, Debug)]
pub(crate) struct IterationLimits {
    /// Steps of the descent at most, grid cells.
    pub(crate) reach: u32,
    pub(crate) kept: Limits,
    /// Least median residual that outliers are measured by, standard deviations.
    pub(crate) least_median: f32,
}

/// The limits that a match must keep.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Limits {
    /// Largest distance: `distance_m + distance_sigmas * sigma(z_b)`.
    pub(crate) distance_m: f32,
    pub(crate) distance_sigmas: f32,
    pub(crate) cosine: f32,
    /// Variance that the error of the pose adds to a residual, square metres.
    pub(crate) pose_variance: f32,
}
