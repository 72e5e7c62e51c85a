//! What a verdict on a run is made of, as plain data.

use crate::replay::Replay;
use crate::statistics::{Ended, RunStatistics};
use crate::trajectories::as_trajectory;
use nalgebra::{Quaternion, UnitQuaternion};
use std::collections::BTreeMap;
use std::fmt;
use tessera_evaluation::{Evaluation, EvaluationOptions, LateralScale, Trajectory, evaluate, lateral_scale};
use tessera_features::FocalRatio;
use tessera_geometry::Pose;
use tessera_slam::{ColourModel, FrameRecord, State};

/// Stated standard deviation of a position above which it is not to be relied on, metres.
pub(crate) const UNCERTAIN_M: f64 = 0.1;

/// Positions of the variances of x, y, z in the upper triangle of a 6x6 matrix, row by row.
const POSITION: [usize; 3] = [0, 6, 11];
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

/// Frames one after the other, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Index of the first frame.
    pub first: u64,
    /// Index of the last frame.
    pub last: u64,
    /// Time of the first since the run's first frame, seconds.
    pub from_s: f64,
    /// Time of the last, seconds.
    pub to_s: f64,
}

impl Span {
    /// From the first frame to the last, seconds.
    pub fn duration_s(&self) -> f64 {
        self.to_s - self.from_s
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.first == self.last {
            true => write!(f, "frame {} ({:.1} s)", self.first, self.from_s),
            false => {
                write!(f, "frames {} to {} ({:.1} to {:.1} s)", self.first, self.last, self.from_s, self.to_s)
            }
        }
    }
}

/// What the ground truth says of lengths.
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
    /// Whether its turns are those of the run only if w is at the other end of its quaternions.
    pub is_w_at_other_end: bool,
}

/// The facts of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// How it ended.
    pub ended: Ended,
    /// Frames that the source gave.
    pub n_read: u64,
    /// Frames with a record.
    pub n_processed: u64,
    /// Frames left out in a live run.
    pub n_dropped: u64,
    /// Frames that ended their stage again and again.
    pub n_missing: u64,
    /// Frames whose pose is a prediction.
    pub n_untracked: u64,
    /// Where they are.
    pub untracked: Vec<Span>,
    /// Those among them whose depth images hold too little to be aligned.
    pub n_without_depth: u64,
    /// Whether the last frame is one of them.
    pub ends_untracked: bool,
    /// Tracked frames whose surfaces leave a direction of motion open, which the prediction then holds.
    pub n_degenerate: u64,
    /// Where they are.
    pub degenerate: Vec<Span>,
    /// Tracked frames with a stated deviation of position above the limit.
    pub n_uncertain: u64,
    /// The first of them.
    pub first_uncertain: Option<u64>,
    /// Largest stated deviation of a position, metres.
    pub worst_deviation_m: f64,
    /// Frames with a missing or broken image, and what is wrong.
    pub broken: BTreeMap<u64, String>,
    /// Loops that the optimisation kept.
    pub n_loops_closed: u64,
    /// Loops that passed verification and that the optimisation rejected.
    pub n_loops_rejected: u64,
    /// Submaps that began.
    pub n_submaps: u64,
    /// Processed frames of each submap that is apart from that of `trajectory.txt`.
    pub apart: BTreeMap<u32, u64>,
    /// Started in a map and never found there.
    pub is_nowhere: bool,
    /// Lengths against the ground truth, where there is one.
    pub truth: Option<Truth>,
    /// Raw depth of a metre.
    pub units_per_metre: f64,
    /// Focal length of the camera along x, pixels.
    pub focal_px: f64,
    /// What features say of it.
    pub seen_focal: Option<FocalRatio>,
    /// Motions across the view against the true ones, as that camera saw them, where they tell something.
    pub lateral: Option<LateralScale>,
    /// Log odds at the end of the run that colour is of the time and place of depth, where it is not believed.
    pub unbelieved_colour: Option<f64>,
    /// Focal length of the camera and of the refined one, pixels.
    pub refined_focal_px: Option<[f64; 2]>,
    /// What looked wrong with the source before the run.
    pub source_doubts: Vec<String>,
    /// What was assumed of it, left out or mended.
    pub source_warnings: Vec<String>,
}

/// What lies in the run directory beside the journal.
#[derive(Clone, Debug, Default)]
pub struct Beside {
    /// Frames with a missing or broken image.
    pub broken: BTreeMap<u64, String>,
    /// What looked wrong with the source before the run.
    pub source_doubts: Vec<String>,
    /// What was assumed of it, left out or mended.
    pub source_warnings: Vec<String>,
    /// Raw depth of a metre.
    pub units_per_metre: f64,
    /// Focal length along x, pixels.
    pub focal_px: f64,
    /// What features say of it.
    pub seen_focal: Option<FocalRatio>,
    /// What the ground truth says of it.
    pub lateral: Option<LateralScale>,
    /// What the camera file states of colour.
    pub stated_colour: ColourModel,
    /// Corrections that the base of a fleet computed, where the run asked one.
    pub n_from_base: Option<u64>,
}

impl Facts {
    /// Collects the facts.
    pub fn new(
        replay: &Replay,
        statistics: &RunStatistics,
        truth: Option<&Trajectory>,
        beside: &Beside,
    ) -> Self {
        let (processed, dropped) = (replay.frames.len() as u64, replay.n_skipped());
        let n_read = replay.n_source_frames.unwrap_or(0).max(processed.saturating_add(dropped));
        let mut frames = FrameFacts::default();
        replay.frames.iter().for_each(|frame| frames.add(frame));
        let colour = replay.colour(beside.stated_colour);
        let refined = replay.refined().map(|refined| [beside.focal_px, refined.camera.fx]);
        Self {
            ended: statistics.ended,
            n_read,
            n_dropped: dropped,
            n_missing: n_read - processed - dropped,
            broken: beside.broken.clone(),
            n_loops_closed: replay.n_loops_closed(),
            n_loops_rejected: replay.n_loops_rejected(),
            n_submaps: u64::from(replay.submaps().n()),
            apart: replay.apart(),
            is_nowhere: replay.n_map_keyframes > 0 && replay.first_tracked.is_none(),
            truth: truth.and_then(|truth| lengths(replay, truth)),
            units_per_metre: beside.units_per_metre,
            focal_px: beside.focal_px,
            seen_focal: beside.seen_focal,
            lateral: beside.lateral,
            unbelieved_colour: (!colour.is_trusted()).then_some(colour.own_nats),
            refined_focal_px: refined,
            source_doubts: beside.source_doubts.clone(),
            source_warnings: beside.source_warnings.clone(),
            ..frames.facts
        }
    }
}

/// What processed frames say, counted as they come: also of a run that goes on.
#[derive(Clone, Debug, Default)]
pub struct FrameFacts {
    facts: Facts,
    first_nanos: Option<i64>,
    is_degenerate: bool,
}

impl FrameFacts {
    /// Takes the next frame in.
    pub fn add(&mut self, frame: &FrameRecord) {
        let first_nanos = *self.first_nanos.get_or_insert(frame.stamp_nanos);
        let at = (frame.index, frame.stamp_nanos.saturating_sub(first_nanos) as f64 * 1e-9);
        let facts = &mut self.facts;
        let (is_untracked, is_degenerate) = (frame.state != State::Tracking, frame.is_degenerate());
        facts.n_processed += 1;
        facts.n_untracked += u64::from(is_untracked);
        facts.n_without_depth += u64::from(is_untracked && frame.has_too_few_points());
        facts.n_degenerate += u64::from(is_degenerate);
        if is_untracked {
            extend(&mut facts.untracked, facts.ends_untracked, at);
        }
        if is_degenerate {
            extend(&mut facts.degenerate, self.is_degenerate, at);
        }
        (facts.ends_untracked, self.is_degenerate) = (is_untracked, is_degenerate);
        let Some(deviation) = deviation_m(frame).filter(|_| !is_untracked) else { return };
        facts.worst_deviation_m = facts.worst_deviation_m.max(deviation);
        if deviation > UNCERTAIN_M {
            facts.n_uncertain += 1;
            facts.first_uncertain.get_or_insert(frame.index);
        }
    }

    /// Those of all frames so far; what else a run has is as by default.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }
}

/// Lengthens the last span, where it goes on, to the frame of that index and time, or begins one there.
fn extend(spans: &mut Vec<Span>, goes_on: bool, (index, at_s): (u64, f64)) {
    match spans.last_mut().filter(|_| goes_on) {
        Some(span) => (span.last, span.to_s) = (index, at_s),
        None => spans.push(Span { first: index, last: index, from_s: at_s, to_s: at_s }),
    }
}

/// Stated standard deviation of a position along the worst of all directions, from above: the root
/// of the sum of the three variances, metres.
pub fn deviation_m(frame: &FrameRecord) -> Option<f64> {
    let variances = POSITION.map(|at| frame.pose.covariance.get(at).copied());
    let [Some(x), Some(y), Some(z)] = variances else { return None };
    Some((x + y + z).max(0.0).sqrt())
}

/// The scale of the tracked frames against the truth; `None` where too little can be compared.
fn lengths(replay: &Replay, truth: &Trajectory) -> Option<Truth> {
    let options = EvaluationOptions { scale: true, ..EvaluationOptions::default() };
    let tracked = tracked(replay)?;
    let found = evaluate(&tracked, truth, &options).ok()?;
    let scaled = found.with_scale.filter(|scaled| found.pairs >= LEAST_POSES && scaled.scale > 0.0)?;
    let spread_m = scaled.scale * spread_m(&tracked);
    let is_telling = spread_m > LEAST_SPREAD_M
        && scaled.ate_rmse_m < TELLING_SHARE * found.ate_rmse_m
        && scaled.ate_rmse_m < LEFT_SHARE * spread_m;
    let turns = |found: &Evaluation| found.rpe_rotation_rmse_deg_per_s;
    let is_w_at_other_end =
        turns(&found).filter(|as_read| *as_read > LEAST_TURN_DEG).is_some_and(|as_read| {
            let reordered = w_at_other_end(truth).map(|truth| evaluate(&tracked, &truth, &options).ok());
            reordered.iter().flatten().filter_map(turns).any(|turn| turn < TELLING_TURN * as_read)
        });
    Some(Truth { scale: scaled.scale, is_telling, ate_m: found.ate_rmse_m, spread_m, is_w_at_other_end })
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
    use tessera_slam::Cause;

    #[test]
    fn the_facts_are_those_of_the_journal() {
        let replay = test_run::replay();
        let statistics = RunStatistics { ended: Ended::Finished, ..RunStatistics::default() };
        let facts = Facts::new(&replay, &statistics, None, &Beside::default());
        assert_eq!((facts.n_read, facts.n_processed, facts.n_dropped, facts.n_missing), (7, 6, 1, 0));
        assert_eq!((facts.n_untracked, facts.untracked.len(), facts.ends_untracked), (1, 1, false));
        assert_eq!(facts.untracked[0].to_string(), "frame 4 (0.1 s)");
        assert_eq!((facts.n_loops_closed, facts.n_loops_rejected), (1, 1));
        // The one covariance is that of a frame that was not tracked.
        assert_eq!((facts.n_uncertain, facts.worst_deviation_m), (0, 0.0));
    }

    #[test]
    fn degenerate_frames_are_those_that_say_so_and_were_tracked() {
        let mut replay = test_run::replay();
        let n = replay.frames.len();
        for frame in &mut replay.frames[n - 3..] {
            frame.state = State::Tracking;
            frame.causes = vec![Cause::Degenerate(Vec::new())];
        }
        replay.frames[n - 1].state = State::Lost;
        let facts = Facts::new(&replay, &RunStatistics::default(), None, &Beside::default());
        let (first, last) = (replay.frames[n - 3].index, replay.frames[n - 2].index);
        assert_eq!(facts.n_degenerate, 2);
        assert_eq!((facts.degenerate[0].first, facts.degenerate[0].last), (first, last));
    }

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

    #[test]
    fn quaternions_with_w_at_the_other_end_are_noticed() {
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
        assert!(!lengths(&replay, &truth).unwrap().is_w_at_other_end);
        for swapped in w_at_other_end(&truth) {
            assert!(lengths(&replay, &swapped).unwrap().is_w_at_other_end);
        }
        let [there, _] = w_at_other_end(&truth);
        let [_, back] = w_at_other_end(&there);
        assert!(back.poses[40].rotation.angle_to(&truth.poses[40].rotation) < 1e-6);
    }
}
