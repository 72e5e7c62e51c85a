//! The errors of a run against the ground truth.

use crate::trajectories::{Rows, as_trajectory};
use serde::Serialize;
use std::collections::BTreeMap;
use tessera_evaluation::{Evaluation, EvaluationOptions, Trajectory, evaluate};

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
    /// World frames of the poses, each aligned to the ground truth by itself; absent where it is one.
    #[serde(skip_serializing_if = "is_one")]
    pub world_frames: usize,
}

fn is_one(n: &usize) -> bool {
    *n == 1
}

/// The errors of a trajectory; `None` where too little overlaps with the ground truth.
pub(crate) fn accuracy(rows: &Rows, groundtruth: &Trajectory) -> Option<Accuracy> {
    accuracy_by_gauge(rows, &vec![0; rows.len()], groundtruth)
}

/// The errors of poses in several world frames, `gauges` naming that of each row: each part is aligned
/// to the ground truth by itself, motions are compared within a part, and errors of all parts are
/// summed up together. How far the end is off is said of the part with the last row. Parts that
/// cannot be compared are left out.
pub(crate) fn accuracy_by_gauge(rows: &Rows, gauges: &[u32], groundtruth: &Trajectory) -> Option<Accuracy> {
    let mut parts: BTreeMap<u32, Rows> = BTreeMap::new();
    for (row, gauge) in rows.iter().zip(gauges) {
        parts.entry(*gauge).or_default().push(*row);
    }
    let evaluated = parts.iter().filter_map(|(gauge, rows)| {
        let options = EvaluationOptions::default();
        Some((*gauge, evaluate(&as_trajectory(rows)?, groundtruth, &options).ok()?))
    });
    let evaluated: Vec<(u32, Evaluation)> = evaluated.collect();
    // One part is said as it is, to the last digit.
    let pooled = |of: &dyn Fn(&Evaluation) -> Option<(f64, usize)>| match evaluated.as_slice() {
        [(_, only)] => of(only).map(|(rmse, _)| rmse),
        parts => root_mean_square(parts.iter().filter_map(|(_, part)| of(part))),
    };
    let at_end = evaluated.iter().find(|(gauge, _)| gauges.last() == Some(gauge)).or(evaluated.last())?;
    Some(Accuracy {
        ate_rmse_m: pooled(&|part| Some((part.ate_rmse_m, part.pairs)))?,
        rpe_translation_rmse_m_per_s: pooled(&|part| {
            Some((part.rpe_translation_rmse_m_per_s?, part.rpe_pairs))
        }),
        rpe_rotation_rmse_deg_per_s: pooled(&|part| {
            Some((part.rpe_rotation_rmse_deg_per_s?, part.rpe_pairs))
        }),
        end_error_m: at_end.1.end_error_m,
        pairs: evaluated.iter().map(|(_, part)| part.pairs).sum(),
        world_frames: evaluated.len(),
    })
}

/// The root mean square of all errors from that of each part with the number of its errors.
fn root_mean_square(parts: impl Iterator<Item = (f64, usize)>) -> Option<f64> {
    let (sum, n) =
        parts.fold((0.0, 0_usize), |(sum, n), (rmse, m)| (sum + rmse * rmse * m as f64, n.saturating_add(m)));
    (n > 0).then(|| (sum / n as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use tessera_geometry::Pose;

    /// A way through space that no rigid motion maps to itself.
    fn way(k: i64) -> Pose {
        let t = k as f64 * 0.1;
        Pose::translation(t.sin(), 0.5 * t, (0.3 * t).cos()) * Pose::rotation(Vector3::y() * (0.1 * t))
    }

    fn rows(world_from_part: impl Fn(i64) -> Pose) -> Rows {
        (0..80).map(|k| (k * 100_000_000, world_from_part(k) * way(k))).collect()
    }

    #[test]
    fn each_world_frame_is_aligned_by_itself() {
        let truth = as_trajectory(&rows(|_| Pose::identity())).unwrap();
        let elsewhere = Pose::translation(7.0, -3.0, 1.0) * Pose::rotation(Vector3::x());
        let in_two = rows(|k| if k < 30 { Pose::identity() } else { elsewhere });
        let gauges: Vec<u32> = (0..80).map(|k| u32::from(k >= 30)).collect();
        let found = accuracy_by_gauge(&in_two, &gauges, &truth).unwrap();
        assert!(found.ate_rmse_m < 1e-9 && found.end_error_m < 1e-9, "{found:?}");
        assert!(found.rpe_translation_rmse_m_per_s.unwrap() < 1e-9, "{found:?}");
        assert_eq!((found.pairs, found.world_frames), (80, 2));
        assert!(accuracy(&in_two, &truth).unwrap().ate_rmse_m > 1.0, "as one they are no trajectory");
    }

    #[test]
    fn errors_of_all_parts_count_by_their_number() {
        let truth = as_trajectory(&rows(|_| Pose::identity())).unwrap();
        let shaken = |k: i64| Pose::translation(if k % 2 == 0 { 0.1 } else { -0.1 }, 0.0, 0.0);
        let one_is_off = rows(|k| if k < 20 { shaken(k) } else { Pose::identity() });
        let gauges: Vec<u32> = (0..80).map(|k| u32::from(k >= 20)).collect();
        let found = accuracy_by_gauge(&one_is_off, &gauges, &truth).unwrap();
        let of_one = accuracy(&one_is_off[..20].to_vec(), &truth).unwrap();
        assert!((found.ate_rmse_m - of_one.ate_rmse_m / 2.0).abs() < 1e-9, "{found:?} {of_one:?}");
        // A part too short to be compared is left out.
        let lonely: Vec<u32> = (0..80).map(|k| u32::from(k == 79)).collect();
        let found = accuracy_by_gauge(&one_is_off, &lonely, &truth).unwrap();
        assert_eq!((found.pairs, found.world_frames), (79, 1));
    }
}
