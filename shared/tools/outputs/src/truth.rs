//! What a ground truth tells of a run: of its lengths, and of turns that are in another order or in a mirror.

use crate::replay::Replay;
use crate::trajectories::as_trajectory;
use nalgebra::{Quaternion, Translation3, UnitQuaternion};
use tessera_evaluation::{Evaluation, EvaluationOptions, LateralScale, Trajectory, evaluate, lateral_scale};
use tessera_geometry::Pose;
use tessera_slam::State;

/// Poses that a comparison of lengths needs.
const LEAST_POSES: usize = 20;
/// A scale tells something where it takes the error down to this share of what it was,
const TELLING_SHARE: f64 = 0.5;
/// where what is left is this share of the way gone, root mean square about its middle,
const LEFT_SHARE: f64 = 0.25;
/// and where that is at least so long, metres: less may as well be drift.
const LEAST_SPREAD_M: f64 = 0.1;
/// Turns tell the order of a quaternion where they are off by more than this over a second, degrees,
const LEAST_TURN_DEG: f64 = 1.0;
/// and by less than this share of it in the other order.
const TELLING_TURN: f64 = 0.2;

/// A ground truth against the lengths and turns of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Factor on the estimate that fits best.
    pub scale: f64,
    /// Whether the factor explains most of the error.
    pub is_telling: bool,
    /// Root mean square error of the positions, metres.
    pub ate_m: f64,
    /// Root mean square distance of the positions from their middle, by that factor, metres.
    pub spread_m: f64,
    /// How its turns are those of the run.
    pub turns: Turns,
}

/// How the turns of a ground truth are those of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Turns {
    /// As they were read, or in no way that is looked for.
    AsRead,
    /// Only if w is at the other end of its quaternions.
    WAtOtherEnd,
    /// Only in a mirror: of the images, or of a world with left-handed axes.
    Mirrored,
}

/// The scale of the tracked frames against the truth; `None` where too little can be compared.
pub(crate) fn lengths(replay: &Replay, truth: &Trajectory) -> Option<Truth> {
    let options = EvaluationOptions { scale: true, ..EvaluationOptions::default() };
    let tracked = tracked(replay)?;
    let found = evaluate(&tracked, truth, &options).ok()?;
    let scaled = found.with_scale.filter(|scaled| found.pairs >= LEAST_POSES && scaled.scale > 0.0)?;
    let spread_m = scaled.scale * spread_m(&tracked);
    let is_telling = spread_m > LEAST_SPREAD_M
        && scaled.ate_rmse_m < TELLING_SHARE * found.ate_rmse_m
        && scaled.ate_rmse_m < LEFT_SHARE * spread_m;
    let turns = turns(&tracked, truth, &found);
    Some(Truth { scale: scaled.scale, is_telling, ate_m: found.ate_rmse_m, spread_m, turns })
}

/// How the turns are those of the run; `found`: compared as they were read.
fn turns(tracked: &Trajectory, truth: &Trajectory, found: &Evaluation) -> Turns {
    let Some(as_read) = found.rpe_rotation_rmse_deg_per_s.filter(|turn| *turn > LEAST_TURN_DEG) else {
        return Turns::AsRead;
    };
    let fits = |changed: &Trajectory| {
        let found = evaluate(tracked, changed, &EvaluationOptions::default()).ok();
        found
            .and_then(|found| found.rpe_rotation_rmse_deg_per_s)
            .is_some_and(|turn| turn < TELLING_TURN * as_read)
    };
    if w_at_other_end(truth).iter().any(fits) {
        Turns::WAtOtherEnd
    } else if mirrored(truth).iter().any(fits) {
        Turns::Mirrored
    } else {
        Turns::AsRead
    }
}

/// The same poses, where what was read with w last had it first, and the other way round.
fn w_at_other_end(truth: &Trajectory) -> [Trajectory; 2] {
    let orders: [fn(Quaternion<f64>) -> Quaternion<f64>; 2] =
        [|q| Quaternion::new(q.i, q.j, q.k, q.w), |q| Quaternion::new(q.k, q.w, q.i, q.j)];
    orders.map(|order| {
        let pose = |pose: &Pose| {
            let rotation = UnitQuaternion::new_normalize(order(*pose.rotation.quaternion()));
            Pose::from_parts(pose.translation, rotation)
        };
        Trajectory { stamps_nanos: truth.stamps_nanos.clone(), poses: truth.poses.iter().map(pose).collect() }
    })
}

/// The same poses in a mirror that exchanges left and right of the images, or top and bottom.
fn mirrored(truth: &Trajectory) -> [Trajectory; 2] {
    let mirrors: [fn(&Pose) -> Pose; 2] = [
        |pose| {
            let (t, q) = (pose.translation.vector, pose.rotation.quaternion());
            let rotation = UnitQuaternion::new_normalize(Quaternion::new(q.w, q.i, -q.j, -q.k));
            Pose::from_parts(Translation3::new(-t.x, t.y, t.z), rotation)
        },
        |pose| {
            let (t, q) = (pose.translation.vector, pose.rotation.quaternion());
            let rotation = UnitQuaternion::new_normalize(Quaternion::new(q.w, -q.i, q.j, -q.k));
            Pose::from_parts(Translation3::new(t.x, -t.y, t.z), rotation)
        },
    ];
    mirrors.map(|mirror| Trajectory {
        stamps_nanos: truth.stamps_nanos.clone(),
        poses: truth.poses.iter().map(mirror).collect(),
    })
}

/// Motions of the tracked frames across the view against the truth's; `None` where they tell nothing.
/// `as_mapped`: as the run's own camera saw them, for its focal length is what they are to tell.
pub(crate) fn lateral(as_mapped: &Replay, truth: &Trajectory) -> Option<LateralScale> {
    lateral_scale(&tracked(as_mapped)?, truth)
}

/// Final poses of the tracked frames of the main component.
fn tracked(replay: &Replay) -> Option<Trajectory> {
    let main = replay.main_component();
    let frames = replay.frames.iter().filter(|frame| replay.component(frame) == main);
    let tracked = frames.filter(|frame| frame.state == State::Tracking);
    as_trajectory(&tracked.map(|frame| (frame.stamp_nanos, replay.final_pose(frame))).collect())
}

/// Root mean square distance of the positions from their middle, metres.
fn spread_m(trajectory: &Trajectory) -> f64 {
    let n = trajectory.len().max(1) as f64;
    let positions = || trajectory.poses.iter().map(|pose| pose.translation.vector);
    let (mut x, mut y, mut z, mut squares) = (0.0, 0.0, 0.0, 0.0);
    for position in positions() {
        (x, y, z) = (x + position.x, y + position.y, z + position.z);
        squares += position.norm_squared();
    }
    (squares / n - (x * x + y * y + z * z) / (n * n)).max(0.0).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run;
    use crate::trajectories::online_rows;

    #[test]
    fn lengths_are_compared_over_enough_poses() {
        let mut replay = test_run::replay();
        assert_eq!(lengths(&replay, &as_trajectory(&online_rows(&replay)).unwrap()), None);
        let (model, mut truth) = (replay.frames[1].clone(), Trajectory::default());
        replay.frames.clear();
        for k in 0..40_i64 {
            let at =
                |scale: f64| Pose::translation(scale * (k as f64 * 0.2).sin(), scale * k as f64 / 40.0, 0.0);
            let mut frame = model.clone();
            (frame.index, frame.stamp_nanos) = (100 + k as u64, k * 33_000_000);
            frame.pose.keyframe_from_camera = (&at(0.2)).into();
            frame.pose.world_from_camera = (&at(0.2)).into();
            replay.frames.push(frame);
            truth.push(k * 33_000_000, at(1.0)).unwrap();
        }
        let found = lengths(&replay, &truth).unwrap();
        assert!((found.scale - 5.0).abs() < 1e-6 && found.is_telling, "{found:?}");
        // Four fifths of the spread are missing.
        assert!((found.ate_m - 0.8 * found.spread_m).abs() < 1e-6, "{found:?}");
    }

    /// A run that turns and moves, and its poses.
    fn turning() -> (Replay, Trajectory) {
        let mut replay = test_run::replay();
        let (model, mut truth) = (replay.frames[1].clone(), Trajectory::default());
        replay.frames.clear();
        for k in 0..80_i64 {
            let t = k as f64 / 30.0;
            let turn = Pose::rotation(nalgebra::Vector3::new(0.2 * t, 0.5 * t.sin(), 0.1));
            let at = Pose::translation(t.sin(), 0.5 * t, t.cos()) * turn;
            let mut frame = model.clone();
            (frame.index, frame.stamp_nanos) = (100 + k as u64, k * 33_000_000);
            frame.pose.keyframe_from_camera = (&at).into();
            frame.pose.world_from_camera = (&at).into();
            replay.frames.push(frame);
            truth.push(k * 33_000_000, at).unwrap();
        }
        (replay, truth)
    }

    #[test]
    fn quaternions_with_w_at_the_other_end_are_noticed() {
        let (replay, truth) = turning();
        assert_eq!(lengths(&replay, &truth).unwrap().turns, Turns::AsRead);
        for swapped in w_at_other_end(&truth) {
            assert_eq!(lengths(&replay, &swapped).unwrap().turns, Turns::WAtOtherEnd);
        }
        let [there, _] = w_at_other_end(&truth);
        let [_, back] = w_at_other_end(&there);
        assert!(back.poses[40].rotation.angle_to(&truth.poses[40].rotation) < 1e-6);
    }

    #[test]
    fn a_run_in_a_mirror_is_noticed() {
        let (replay, truth) = turning();
        for (mirrored, side) in mirrored(&truth).into_iter().zip([0, 1]) {
            assert_eq!(lengths(&replay, &mirrored).unwrap().turns, Turns::Mirrored);
            // As the matrices of reflections have it.
            let mut mirror = nalgebra::Matrix3::identity();
            mirror[(side, side)] = -1.0;
            let [is, was] = [&mirrored, &truth].map(|poses| poses.poses[40].rotation.to_rotation_matrix());
            assert!((is.matrix() - mirror * was.matrix() * mirror).amax() < 1e-9);
        }
    }
}
