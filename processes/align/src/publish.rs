//! From a journal record to the message that others see.

use tessera_geometry::{Pose, PoseBits, from_upper_triangle};
use tessera_messages::{PoseMessage, StepTimes, pack_reason};
use tessera_slam::{FrameRecord, State};

/// The pose message of a record: a pure function of it, but for the times. What its reason says of the map is
/// in the journal alone where the pose goes out first.
pub(crate) fn pose_message(record: &FrameRecord, times: StepTimes) -> PoseMessage {
    let world_from_odom = Pose::from(&record.pose.world_from_odom);
    let odom_from_camera = world_from_odom.inverse() * Pose::from(&record.pose.world_from_camera);
    PoseMessage {
        index: record.index,
        stamp_nanos: record.stamp_nanos,
        state: match record.state {
            State::Tracking => 0,
            State::Lost => 1,
            State::Relocalising => 2,
        },
        n_correspondences: record.pose.n_correspondences,
        reason: pack_reason(&record.reason()),
        odom_from_camera: seven(&PoseBits::from(&odom_from_camera)),
        world_from_odom: seven(&record.pose.world_from_odom),
        covariance: from_upper_triangle(&record.pose.covariance).into(),
        step_variance: record.evidence.noise.and_then(|noise| noise.step_variance).unwrap_or_default(),
        times,
    }
}

fn seven(pose: &PoseBits) -> [f64; 7] {
    let ([x, y, z], [qx, qy, qz, qw]) = (pose.translation_m, pose.rotation_xyzw);
    [x, y, z, qx, qy, qz, qw]
}
