//! Positions of frames and keyframes in the axes of the report: right, forward, up.

use crate::{Frame, FrameState, Keyframe};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use tessera_evaluation::{AteOptions, Trajectory, ate};
use tessera_geometry::Pose;
use tessera_outputs::{Replay, as_trajectory, deviation_m, final_rows};
use tessera_slam::{FrameRecord, SkippedFrames, State};

/// Ground truth shown before the first and behind the last frame, nanoseconds.
const MARGIN_NANOS: i64 = 50_000_000;

/// Frames and truth in the axes of the report.
pub(super) struct Placed {
    pub(super) frames: Vec<Frame>,
    pub(super) truth_m: Vec<[f64; 3]>,
    /// From the map, through the alignment to the truth, to the axes of the report.
    pub(super) view_from_world: Pose,
    pub(super) view: FrameView,
}

/// Which axes of the world are right, forward and up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FrameView([(usize, f64); 3]);

impl FrameView {
    /// Takes for up the axis of the world that the tops of the images point along on average.
    pub(crate) fn new<'a>(world_from_cameras: impl Iterator<Item = &'a Pose>) -> Self {
        let sum: Vector3<f64> = world_from_cameras.map(|pose| pose.rotation * -Vector3::y()).sum();
        let up = sum.iamax();
        let sign = if sum.get(up).is_some_and(|length| *length < 0.0) { -1.0 } else { 1.0 };
        // Right-handed: right x forward = up.
        Self(match up {
            0 => [(1, 1.0), (2, sign), (0, sign)],
            1 => [(0, 1.0), (2, -sign), (1, sign)],
            _ => [(0, 1.0), (1, sign), (2, sign)],
        })
    }

    fn of(&self, point: &Vector3<f64>) -> [f64; 3] {
        self.0.map(|(axis, sign)| sign * point[axis])
    }

    /// The same as a rotation.
    pub(crate) fn pose(&self) -> Pose {
        let columns = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| Vector3::from(self.of(&axis)));
        let matrix = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&columns));
        Pose::from_parts(Translation3::identity(), UnitQuaternion::from_rotation_matrix(&matrix))
    }
}

/// Frames at their final places, with their errors where the truth is known.
pub(super) fn place(replay: &Replay, truth: Option<&Trajectory>) -> Placed {
    let main = replay.main_component();
    let is_main: Vec<bool> = replay.frames.iter().map(|frame| replay.component(frame) == main).collect();
    let rows = final_rows(replay);
    let compared = truth.and_then(|truth| {
        let options = AteOptions::default();
        ate(&as_trajectory(&rows)?, truth, &options).ok()
    });
    let truth_from_world = compared.as_ref().map_or(Pose::identity(), |ate| ate.groundtruth_from_estimate);
    let poses: Vec<Pose> = rows.iter().map(|(_, pose)| truth_from_world * pose).collect();
    let view = FrameView::new(poses.iter());
    let mut errors = vec![None; poses.len()];
    if let Some(ate) = &compared {
        for ((_, at), error) in ate.pairs.iter().zip(&ate.errors_m) {
            errors.get_mut(*at).into_iter().for_each(|found| *found = Some(*error));
        }
    }
    let begin = replay.frames.first().map_or(0, |frame| frame.stamp_nanos);
    let end = replay.frames.last().map_or(0, |frame| frame.stamp_nanos);
    // Frames of submaps that are apart stand at the frame of the main one before them.
    let places: Vec<(usize, bool)> = is_main
        .iter()
        .scan(0_usize, |n, is_main| {
            *n = n.saturating_add(usize::from(*is_main));
            Some((n.saturating_sub(1), *is_main))
        })
        .collect();
    let mut frames: Vec<Frame> = replay
        .frames
        .iter()
        .zip(&places)
        .map(|(record, (place, is_main))| Frame {
            index: record.index,
            time_s: record.stamp_nanos.saturating_sub(begin) as f64 * 1e-9,
            state: state(record.state),
            reason: record.reason(),
            position_m: poses.get(*place).map_or([0.0; 3], |pose| view.of(&pose.translation.vector)),
            error_m: errors.get(*place).copied().flatten().filter(|_| *is_main),
            std_m: std_m(record),
        })
        .collect();
    add_dropped(&mut frames, &replay.skipped);
    let is_near =
        |stamp: i64| (begin.saturating_sub(MARGIN_NANOS)..=end.saturating_add(MARGIN_NANOS)).contains(&stamp);
    let truth_m = match truth.filter(|_| compared.is_some()) {
        None => Vec::new(),
        Some(truth) => {
            let rows = truth.stamps_nanos.iter().zip(&truth.poses).filter(|(stamp, _)| is_near(**stamp));
            rows.map(|(_, pose)| view.of(&pose.translation.vector)).collect()
        }
    };
    Placed { frames, truth_m, view_from_world: truth_from_world, view }
}

pub(crate) fn state(state: State) -> FrameState {
    match state {
        State::Tracking => FrameState::Tracking,
        State::Lost => FrameState::Lost,
        State::Relocalising => FrameState::Relocalising,
    }
}

/// Standard deviation of the position, from the diagonal of the covariance.
pub(super) fn std_m(record: &FrameRecord) -> Option<f64> {
    deviation_m(record).filter(|std| std.is_finite())
}

/// Marks of frames that were left out; of more than these in a row the page shows the first.
const MOST_DROPPED_IN_A_ROW: usize = 10_000;

/// Frames that were left out stand at the time and place of the frame before them.
fn add_dropped(frames: &mut Vec<Frame>, skipped: &[SkippedFrames]) {
    let listed = |skipped: &SkippedFrames| skipped.listed().take(MOST_DROPPED_IN_A_ROW);
    for (index, reason) in skipped.iter().flat_map(|s| listed(s).map(|index| (index, &s.reason))) {
        let place = frames.partition_point(|frame| frame.index < index);
        let before = place.checked_sub(1).and_then(|place| frames.get(place)).or(frames.first());
        let (time_s, position_m) = before.map_or((0.0, [0.0; 3]), |frame| (frame.time_s, frame.position_m));
        let (state, reason) = (FrameState::Dropped, reason.clone());
        let dropped = Frame { index, time_s, state, reason, position_m, error_m: None, std_m: None };
        frames.insert(place, dropped);
    }
}

/// Space between maps that are apart, metres and as a share of the width of the one before.
pub(super) const GAP_M: f64 = 0.5;
/// As [`GAP_M`].
pub(super) const GAP_SHARE: f64 = 0.1;

/// Keyframes at their final places; submaps that are apart stand to the right of the main map, one
/// beside the other, for how they lie to each other is not known.
pub(super) fn keyframes(replay: &Replay, placed: &Placed) -> Vec<Keyframe> {
    let main_view = placed.view.pose() * placed.view_from_world;
    let mut keyframes: Vec<Keyframe> = replay
        .keyframes
        .iter()
        .zip(replay.keyframe_poses())
        .enumerate()
        .map(|(place, (keyframe, pose))| Keyframe {
            id: keyframe.id,
            position_m: (main_view * pose).translation.vector.into(),
            is_of_map: place < replay.n_map_keyframes,
            apart: None,
            edges: keyframe.edges.iter().map(|edge| edge.to).collect(),
        })
        .collect();
    let mut last =
        MapExtent::of(replay.main_keyframes().map(|(_, pose)| (main_view * pose).translation.vector));
    let middle_m = last.middle_m;
    for component in replay.apart().into_keys() {
        let own: Vec<(u32, Pose)> = replay.keyframes_of(component).map(|(k, pose)| (k.id, pose)).collect();
        let view = FrameView::new(own.iter().map(|(_, pose)| pose));
        let at = |pose: &Pose| Vector3::from(view.of(&pose.translation.vector));
        let span = MapExtent::of(own.iter().map(|(_, pose)| at(pose)));
        let gap_m = GAP_M + GAP_SHARE * (last.right_m - last.left_m);
        let offset = Vector3::new(last.right_m + gap_m - span.left_m, middle_m - span.middle_m, 0.0);
        for (id, pose) in &own {
            if let Some(keyframe) = keyframes.get_mut(*id as usize) {
                (keyframe.position_m, keyframe.apart) = ((at(pose) + offset).into(), Some(component));
            }
        }
        last = MapExtent { left_m: span.left_m + offset.x, right_m: span.right_m + offset.x, middle_m };
    }
    keyframes
}

/// How far keyframes reach to the left and to the right, and the middle of them forward.
#[derive(Clone, Copy, Debug, Default)]
struct MapExtent {
    left_m: f64,
    right_m: f64,
    middle_m: f64,
}

impl MapExtent {
    fn of(positions: impl Iterator<Item = Vector3<f64>>) -> Self {
        let all = positions.map(|at| (at, at)).reduce(|(low, high), (at, _)| (low.inf(&at), high.sup(&at)));
        let Some((low, high)) = all else { return Self::default() };
        Self { left_m: low.x, right_m: high.x, middle_m: 0.5 * (low.y + high.y) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_outputs::test_run;
    use tessera_slam::AlignRecord;

    #[test]
    fn a_camera_s_own_axes_become_right_forward_and_up() {
        let view = FrameView::new([Pose::identity()].iter());
        assert_eq!(view.of(&Vector3::new(1.0, 2.0, 3.0)), [1.0, 3.0, -2.0]);
        // A world with z up, looked at by a camera that looks along its y.
        let turned = Pose::rotation(Vector3::x() * -std::f64::consts::FRAC_PI_2);
        assert_eq!(FrameView::new([turned].iter()).of(&Vector3::new(1.0, 2.0, 3.0)), [1.0, 2.0, 3.0]);
        // As a rotation it is the same.
        let point = Vector3::new(1.0, 2.0, 3.0);
        assert!((view.pose().rotation * point - Vector3::new(1.0, 3.0, -2.0)).norm() < 1e-12);
    }

    #[test]
    fn every_frame_is_there_with_its_state_and_error() {
        let replay = test_run::replay();
        let truth = as_trajectory(&final_rows(&replay)).unwrap();
        let placed = place(&replay, Some(&truth));
        assert_eq!(placed.frames.iter().map(|frame| frame.index).collect::<Vec<_>>(), [0, 1, 2, 3, 4, 5, 6]);
        assert_eq!((placed.frames[4].state, placed.frames[6].state), (FrameState::Lost, FrameState::Dropped));
        assert!(placed.frames[..6].iter().all(|frame| frame.error_m.unwrap() < 1e-9));
        assert!((placed.frames[4].std_m.unwrap() - 0.14f64.sqrt() * 0.1).abs() < 1e-9);
        assert_eq!(placed.truth_m.len(), 6);
        assert_eq!(keyframes(&replay, &placed)[2].edges, [0, 1]);
        assert!(place(&replay, None).truth_m.is_empty());
    }

    #[test]
    fn submaps_that_are_apart_stand_beside_the_main_map() {
        let mut replay = Replay::default();
        for mut record in test_run::records() {
            if let AlignRecord::Frame(frame) = &mut record {
                frame.submap = u32::from(frame.index == 5);
            }
            replay.apply(record);
        }
        let keyframes = keyframes(&replay, &place(&replay, None));
        assert_eq!(keyframes.iter().map(|k| k.apart).collect::<Vec<_>>(), [None, None, Some(1)]);
        // Two at 0 and 1.2 m, the gap, and the third, which is at 0.4 m in its own world frame.
        let right_m: Vec<f64> = keyframes.iter().map(|k| k.position_m[0]).collect();
        let expected = [0.0, 1.2, 1.2 + GAP_M + GAP_SHARE * 1.2];
        assert!(right_m.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{right_m:?}");
    }
}
