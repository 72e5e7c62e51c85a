//! Why two trajectories cannot be compared.

use crate::{Trajectory, format_stamp};

/// Why two trajectories cannot be compared.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EvaluationError {
    /// Times do not overlap.
    #[error(
        "found {found} pairs within {max_difference_s} s, expected at least 2: the estimate spans {estimate} s, \
         the ground truth {groundtruth} s"
    )]
    TooFewPairs {
        /// Pairs found.
        found: usize,
        /// Largest difference of paired times, seconds.
        max_difference_s: f64,
        /// First and last stamp of the estimate.
        estimate: String,
        /// First and last stamp of the ground truth.
        groundtruth: String,
    },
    /// The trajectory is shorter than the motion that RPE compares.
    #[error(
        "found no two poses {delta_s} s apart that have ground truth, expected a trajectory longer than that"
    )]
    NoMotions {
        /// Time between the poses, seconds.
        delta_s: f64,
    },
}

impl EvaluationError {
    pub(crate) fn too_few_pairs(
        found: usize,
        estimate: &Trajectory,
        groundtruth: &Trajectory,
        max_difference_s: f64,
    ) -> Self {
        let span = |trajectory: &Trajectory| match trajectory.stamps_nanos.as_slice() {
            [first, .., last] => format!("{} to {}", format_stamp(*first), format_stamp(*last)),
            [only] => format_stamp(*only),
            [] => "nothing".to_owned(),
        };
        Self::TooFewPairs {
            found,
            max_difference_s,
            estimate: span(estimate),
            groundtruth: span(groundtruth),
        }
    }
}
