//! The published result of one frame.

use crate::message::{Message, Refusal, StepTimes};
use bytemuck::{Pod, Zeroable};

/// Names of the states as [`PoseMessage::state`] counts them.
pub const POSE_STATES: [&str; 3] = ["tracking", "lost", "relocalising"];

/// A pose with its uncertainty. A controller follows `odom_from_camera`, which never jumps;
/// corrections change `world_from_odom`; `world_from_camera` is their product.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct PoseMessage {
    /// Frame index as the source counts.
    pub index: u64,
    /// Sensor time.
    pub stamp_nanos: i64,
    /// Position in [`POSE_STATES`].
    pub state: u32,
    /// Correspondences behind the pose.
    pub n_correspondences: u32,
    /// Why the state is not tracking: UTF-8, zero-padded.
    pub reason: [u8; 64],
    /// Translation in metres, then quaternion `x y z w`.
    pub odom_from_camera: [f64; 7],
    /// Translation in metres, then quaternion `x y z w`.
    pub world_from_odom: [f64; 7],
    /// 6x6 row by row, translation first, metres and radians; all zero where unknown.
    pub covariance: [[f64; 6]; 6],
    /// Variance along and about each axis of the camera with its references fixed, m^2 and rad^2; all zero where
    /// unknown. The motion since the pose before has the variances of both: what `covariance` adds is common to them.
    pub step_variance: [f64; 6],
    /// When each step happened.
    pub times: StepTimes,
}

impl Message for PoseMessage {
    const NAME: &'static str = "tessera.Pose.v2";
}

impl PoseMessage {
    /// Checks that every number can be used.
    ///
    /// # Errors
    /// A [`Refusal`] that names the frame and the value.
    pub fn validate(&self) -> Result<(), Refusal> {
        let index = self.index;
        let refuse = |what, found: String, rule| Err(Refusal::Value { index, what, found, rule });
        if self.state as usize >= POSE_STATES.len() {
            return refuse("state", self.state.to_string(), "0, 1 or 2");
        }
        for (what, pose) in
            [("odom_from_camera", &self.odom_from_camera), ("world_from_odom", &self.world_from_odom)]
        {
            let norm_sq: f64 = pose[3..].iter().map(|v| v * v).sum();
            if !(pose.iter().all(|v| v.is_finite()) && (norm_sq - 1.0).abs() < 1e-5) {
                return refuse(what, format!("{pose:?}"), "finite, with a unit quaternion");
            }
        }
        if !self.covariance.iter().flatten().all(|v| v.is_finite()) {
            return refuse("covariance", "not finite".into(), "36 finite numbers");
        }
        if !self.step_variance.iter().all(|v| v.is_finite() && *v >= 0.0) {
            return refuse(
                "step_variance",
                format!("{:?}", self.step_variance),
                "6 finite numbers from 0 on",
            );
        }
        Ok(())
    }

    /// The reason as text; bytes that are no UTF-8 are replaced.
    pub fn reason_text(&self) -> String {
        let text = self.reason.split(|&byte| byte == 0).next().unwrap_or_default();
        String::from_utf8_lossy(text).into_owned()
    }
}

/// Packs a text into fixed bytes, cut at a character border.
pub fn pack_reason(text: &str) -> [u8; 64] {
    let mut packed = [0; 64];
    let is_end = |end: &usize| text.is_char_boundary(*end);
    let end = (0..=text.len().min(packed.len())).rev().find(is_end).unwrap_or(0);
    packed.iter_mut().zip(text.as_bytes().iter().take(end)).for_each(|(to, byte)| *to = *byte);
    packed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_that_is_no_pose_is_refused() {
        let mut pose = PoseMessage::zeroed();
        pose.odom_from_camera[6] = 1.0;
        assert!(pose.validate().unwrap_err().to_string().contains("world_from_odom"));
        pose.world_from_odom[6] = 1.0;
        assert_eq!(pose.validate(), Ok(()));
        pose.covariance[2][3] = f64::NAN;
        assert!(pose.validate().unwrap_err().to_string().contains("covariance"));
        pose.covariance[2][3] = 0.0;
        pose.step_variance[1] = -1.0;
        assert!(pose.validate().unwrap_err().to_string().contains("step_variance"));
    }

    #[test]
    fn long_reasons_are_cut_between_characters() {
        let text = "é".repeat(40);
        let pose = PoseMessage { reason: pack_reason(&format!("x{text}")), ..PoseMessage::zeroed() };
        assert_eq!(pose.reason_text(), format!("x{}", "é".repeat(31)));
    }
}
