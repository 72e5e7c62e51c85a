//! Where the features of a pair have the camera, beside where its track has it.

use crate::evidence::pose_agreement::UncertainPose;
use crate::map::records::PoseRecord;
use crate::map::state::KeyframeState;
use crate::pairs::weighted_pair::FeaturePair;
use crate::tracking::covariance;
use crate::tracking::input::TrackingInput;
use tessera_geometry::{Matrix6, Pose};
use tessera_graph::{PairBlock, metric_covariance};

/// A keyframe's pose. What has no covariance, as a map's first keyframe, is where it is.
pub(crate) fn of_keyframe(keyframe: &KeyframeState) -> UncertainPose {
    let pose = &keyframe.world_from_camera;
    UncertainPose::read(pose, &keyframe.covariance)
        .unwrap_or_else(|| UncertainPose { pose: Pose::from(pose), covariance: Matrix6::zeros() })
}

/// `older_from_camera` by the track and by the features of a pair; `None` where a covariance is not known.
pub(crate) fn known_and_seen(
    input: &TrackingInput<'_>,
    older: &KeyframeState,
    pair: &FeaturePair,
    pose: &PoseRecord,
) -> Option<[UncertainPose; 2]> {
    let at = pair.target_from_query;
    let information = PairBlock::new(&at, &pair.sums).linearise(&at).0;
    let by_matches = metric_covariance(&information, input.context.scales.features)?;
    let common = covariance::of_calibration(&input.map.state().colour, input.context, &[&pair.sums]);
    let seen = UncertainPose { pose: at, covariance: by_matches + common };
    let older_pose = of_keyframe(older);
    let camera = UncertainPose::read(&pose.world_from_camera, &pose.covariance)?;
    let is_of_track = input.map.is_own(older) && older.submap == input.map.submap();
    let relative = if is_of_track { UncertainPose::along_track } else { UncertainPose::apart };
    Some([relative(&older_pose, &camera), seen])
}
