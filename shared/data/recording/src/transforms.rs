//! Where the colour camera stands from the depth camera: a RealSense's extrinsics, or `/tf_static`.

use crate::chunks::{Chunks, FoundMessage};
use crate::error::MessageError;
use crate::librealsense;
use crate::messages;
use crate::ros;
use nalgebra::{Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion};
use std::collections::BTreeMap;
use tessera_geometry::Pose;

/// Longest chain from a camera to the root.
const MOST_LINKS: usize = 64;
/// How far a rotation may be from one.
const MOST_SKEW: f64 = 0.01;

/// The transform of points, metres; `None`: the recording does not say.
pub(super) fn colour_from_depth(
    chunks: &Chunks,
    found: &FoundMessage,
    depth_frame: &str,
    colour_frame: &str,
) -> Option<Pose> {
    if let Some(spot) = &found.extrinsics
        && let Ok(data) = chunks.read(spot)
        && let Ok(extrinsics) = messages::extrinsics(spot.kind, &data)
        && let Some(pose) = of_extrinsics(&extrinsics)
    {
        return Some(pose);
    }
    between_frames(chunks, found, depth_frame, colour_frame)
}

/// The transform of points from one frame to another by `/tf_static`; `None`: the recording does not say.
pub(super) fn between_frames(chunks: &Chunks, found: &FoundMessage, from: &str, to: &str) -> Option<Pose> {
    if from.is_empty() || to.is_empty() {
        return None;
    }
    static_frames(chunks, found).between(from, to)
}

/// All frames of the recording whose transforms stay.
pub(super) fn static_frames(chunks: &Chunks, found: &FoundMessage) -> FrameTree {
    let mut tree = FrameTree::default();
    for spot in &found.transforms {
        let Ok(data) = chunks.read(spot) else { continue };
        if let Ok(links) = messages::transforms(spot.kind, &data) {
            tree.extend(links);
        }
    }
    for (stream, reference, spot) in &found.streams {
        let Ok(data) = chunks.read(spot) else { continue };
        if let Some(place) = librealsense::place(&data).ok().and_then(|place| pose(&place)) {
            tree.parents.insert(stream.clone(), (reference.clone(), place.inverse()));
        }
    }
    tree
}

/// Coordinate frames with the poses in their parents, as `/tf_static` has them.
#[derive(Clone, Debug, Default)]
pub struct FrameTree {
    parents: BTreeMap<String, (String, Pose)>,
}

impl FrameTree {
    /// Adds the transforms of a `tf2_msgs/msg/TFMessage` in CDR; those that are no poses are left out.
    ///
    /// # Errors
    /// Where the bytes are no such message.
    pub fn add(&mut self, message: &[u8]) -> Result<(), MessageError> {
        self.extend(ros::transforms(message)?);
        Ok(())
    }

    fn extend(&mut self, links: Vec<(String, String, ros::RosPose)>) {
        for (parent, child, transform) in links {
            if let Some(pose) = pose(&transform) {
                self.parents.insert(child, (parent, pose));
            }
        }
    }

    /// The transform of points from one frame to another, metres; `None`: the tree does not say.
    pub fn between(&self, from: &str, to: &str) -> Option<Pose> {
        between(&self.parents, from, to)
    }
}

fn pose(message: &ros::RosPose) -> Option<Pose> {
    let ([x, y, z], [qx, qy, qz, qw]) = (message.position, message.orientation_xyzw);
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    let is_pose = [x, y, z].iter().all(|v| v.is_finite()) && (0.9..1.1).contains(&quaternion.norm());
    let rotation = UnitQuaternion::from_quaternion(quaternion);
    is_pose.then(|| Pose::from_parts(Translation3::new(x, y, z), rotation))
}

fn of_extrinsics(extrinsics: &ros::Extrinsics) -> Option<Pose> {
    let rotation = Matrix3::from_column_slice(&extrinsics.rotation);
    let [x, y, z] = extrinsics.translation;
    let skew = (rotation * rotation.transpose() - Matrix3::identity()).amax();
    let is_pose =
        skew <= MOST_SKEW && rotation.determinant() > 0.0 && [x, y, z].iter().all(|v| v.abs() < 10.0);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    is_pose.then(|| Pose::from_parts(Translation3::new(x, y, z), rotation))
}

/// `to_from_from` along the tree of `child: (parent, parent_from_child)`.
fn between(parents: &BTreeMap<String, (String, Pose)>, from: &str, to: &str) -> Option<Pose> {
    let root = |frame: &str| {
        let (mut frame, mut root_from_frame) = (frame.to_owned(), Pose::identity());
        for _ in 0..MOST_LINKS {
            let Some((parent, parent_from_child)) = parents.get(&frame) else {
                return Some((frame, root_from_frame));
            };
            root_from_frame = parent_from_child * root_from_frame;
            frame.clone_from(parent);
        }
        // A circle.
        None
    };
    let ((root_a, root_from_a), (root_b, root_from_b)) = (root(from)?, root(to)?);
    (root_a == root_b).then(|| root_from_b.inverse() * root_from_a)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shift(x: f64) -> Pose {
        Pose::from_parts(Translation3::new(x, 0.0, 0.0), UnitQuaternion::identity())
    }

    #[test]
    fn frames_of_one_tree_have_a_transform() {
        let mut parents = BTreeMap::new();
        let mut add =
            |child: &str, parent: &str, x| parents.insert(child.to_owned(), (parent.to_owned(), shift(x)));
        add("depth", "link", 0.5);
        add("colour", "frame", 0.25);
        add("frame", "link", 0.125);
        add("other", "elsewhere", 1.0);
        add("a", "b", 1.0);
        add("b", "a", 1.0);
        // A point at 0 of depth is at 0.5 of the link, and the colour camera at 0.375.
        let found = between(&parents, "depth", "colour").unwrap();
        assert!((found.translation.x - 0.125).abs() < 1e-12);
        assert!(between(&parents, "depth", "depth").unwrap().translation.vector.norm() < 1e-12);
        assert_eq!(between(&parents, "depth", "other"), None);
        assert_eq!(between(&parents, "depth", "a"), None);
    }

    #[test]
    fn extrinsics_that_are_no_rotation_are_left() {
        let rotation = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
        let good = ros::Extrinsics { rotation, translation: [0.015, 0.0, 0.0] };
        assert!((of_extrinsics(&good).unwrap().translation.x - 0.015).abs() < 1e-12);
        assert_eq!(of_extrinsics(&ros::Extrinsics { rotation: [0.5; 9], ..good }), None);
    }
}
