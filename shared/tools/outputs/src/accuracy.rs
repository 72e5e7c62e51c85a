//! The errors of a run against the ground truth.

use crate::trajectories::{Rows, as_trajectory};
use serde::Serialize;
use tessera_evaluation::{EvaluationOptions, Trajectory, evaluate};

/// Errors against the ground truth, by the definitions of the TUM scripts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Accuracy {
    /// Absolute trajectory error, metres.
    pub ate_rmse_m: f64,
    /// Relative pose error over one second; absent where the run is shorter.
    pub rpe_translation_rmse_m_per_s: Option<f64>,
    /// Relative pose error over one second; absent where the run is shorter.
    pub rpe_rotation_rmse_deg_per_s: Option<f64>,
    /// How far the last pose is off, seen from the first, metres.
    pub end_error_m: f64,
    /// Poses compared.
    pub pairs: usize,
}

/// The errors of a trajectory; `None` where too little overlaps with the ground truth.
pub(crate) fn accuracy(rows: &Rows, groundtruth: &Trajectory) -> Option<Accuracy> {
    let estimate = as_trajectory(rows)?;
    let evaluation = evaluate(&estimate, groundtruth, &EvaluationOptions::default()).ok()?;
    Some(Accuracy {
        ate_rmse_m: evaluation.ate_rmse_m,
        rpe_translation_rmse_m_per_s: evaluation.rpe_translation_rmse_m_per_s,
        rpe_rotation_rmse_deg_per_s: evaluation.rpe_rotation_rmse_deg_per_s,
        end_error_m: evaluation.end_error_m,
        pairs: evaluation.pairs,
    })
}
