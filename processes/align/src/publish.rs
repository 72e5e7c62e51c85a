//! From a journal record to the message that others see.

use tessera_geometry::{Pose, PoseBits};
use tessera_messages::{PoseMessage, StepTimes, pack_reason};
use tessera_slam::{FrameRecord, State};

/// The pose message of a record: a pure function of it, but for the times.
pub(crate) fn pose_message(record: &FrameRecord, times: StepTimes) -> PoseMessage {
    let world_from_odom = Pose::from(&record.world_from_odom);
    let odom_from_camera = world_from_odom.inverse() * Pose::from(&record.world_from_camera);
    PoseMessage {
        index: record.index,
        stamp_nanos: record.stamp_nanos,
        state: match record.state {
            State::Tracking => 0,
            State::Lost => 1,
            State::Relocalising => 2,
        },
        n_correspondences: record.n_correspondences,
        reason: pack_reason(&record.reason),
        odom_from_camera: seven(&PoseBits::from(&odom_from_camera)),
        world_from_odom: seven(&record.world_from_odom),
        covariance: symmetric(&record.covariance),
        times,
    }
}

fn seven(pose: &PoseBits) -> [f64; 7] {
    let ([x, y, z], [qx, qy, qz, qw]) = (pose.translation_m, pose.rotation_xyzw);
    [x, y, z, qx, qy, qz, qw]
}

/// The full matrix of an upper triangle, row by row; zero where there is none.
fn symmetric(upper: &[f64]) -> [[f64; 6]; 6] {
    let mut full = [[0.0; 6]; 6];
    if upper.len() == 21 {
        let mut values = upper.iter();
        for row in 0..6 {
            for column in row..6 {
                let value = values.next().copied().unwrap_or_default();
                full[row][column] = value;
                full[column][row] = value;
            }
        }
    }
    full
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_upper_triangle_fills_both_sides() {
        let upper: Vec<f64> = (0..21).map(f64::from).collect();
        let full = symmetric(&upper);
        assert_eq!((full[0][5], full[5][0], full[1][1], full[5][5]), (5.0, 5.0, 6.0, 20.0));
        assert_eq!(symmetric(&[]), [[0.0; 6]; 6]);
    }
}
