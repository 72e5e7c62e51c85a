//! Poses of a whole run, as a fold over the aligner's journal: the outputs, the offline runner and the viewer
//! have the poses that the tracker went on with.

use crate::map::correction::{Correction, RefinedCamera};
use crate::map::keyframe::KeyframeRecord;
use crate::map::placement::{HasPlacement, Placement};
use crate::map::placement::{apply_correction, apply_join, apply_poses, apply_retired, apply_split};
use crate::map::records::{AlignRecord, FrameRecord};
use crate::map::submaps::Submaps;
use std::collections::BTreeMap;
use tessera_geometry::{Pose, PoseBits};

/// Origin of a frame's pose: the part of its record that its final pose needs.
#[derive(Clone, Copy, Debug)]
pub struct FramePose {
    /// Frame index.
    pub index: u64,
    /// Reference keyframe.
    pub keyframe: u32,
    /// Pose relative to that keyframe.
    pub keyframe_from_camera: PoseBits,
    /// Pose as first published.
    pub world_from_camera: PoseBits,
}

impl From<&FrameRecord> for FramePose {
    fn from(frame: &FrameRecord) -> Self {
        Self {
            index: frame.index,
            keyframe: frame.pose.keyframe,
            keyframe_from_camera: frame.pose.keyframe_from_camera,
            world_from_camera: frame.pose.world_from_camera,
        }
    }
}

/// Poses of all keyframes, and what the final pose of each frame needs beside its record: a fold
/// over the aligner's journal.
#[derive(Clone, Debug, Default)]
pub struct PoseHistory {
    /// All keyframes as corrected so far, by id.
    keyframes: Vec<Placement>,
    /// Which submaps are joined so far.
    submaps: Submaps,
    /// Which keyframe a frame of this run became.
    keyframe_of_frame: BTreeMap<u64, u32>,
    /// `world_from_camera` of frames that the last correction solved again.
    solved: BTreeMap<u64, PoseBits>,
}

impl PoseHistory {
    /// Takes the next record in.
    pub fn apply(&mut self, record: &AlignRecord) {
        match record {
            AlignRecord::Map(map) => {
                self.keyframes.extend(map.keyframes.iter().map(HasPlacement::placement));
                self.submaps.clone_from(&map.submaps);
            }
            AlignRecord::Frame(frame) => {
                apply_poses(&mut self.keyframes, &frame.change.moved);
                self.submaps.extend_to(frame.submap);
                if let Some(keyframe) = &frame.change.new_keyframe {
                    self.add_keyframe(keyframe, frame.submap);
                }
                if let Some(split) = &frame.change.split {
                    apply_split(&mut self.keyframes, split, frame.submap);
                }
                if let Some(join) = &frame.change.join {
                    apply_join(&mut self.keyframes, &mut self.submaps, join);
                }
            }
            AlignRecord::Correction(applied) => self.apply_correction(&applied.correction),
            AlignRecord::Skipped(..) | AlignRecord::End { .. } => {}
        }
    }

    fn add_keyframe(&mut self, keyframe: &KeyframeRecord, submap: u32) {
        self.keyframe_of_frame.insert(keyframe.frame_index, keyframe.id);
        let world_from_camera = keyframe.world_from_camera;
        self.keyframes.push(Placement { submap, world_from_camera, anchored_to: None });
        keyframe.retires.iter().for_each(|retired| apply_retired(&mut self.keyframes, retired));
    }

    /// Frames solved against poses that have moved since are no longer solved.
    fn apply_correction(&mut self, correction: &Correction) {
        if apply_correction(&mut self.keyframes, correction).is_some() {
            self.solved = correction.frames.iter().copied().collect();
            self.submaps.judge(&correction.submaps);
        }
    }

    /// The same run with the poses that go with a refined camera.
    pub fn with_refined_camera(&self, refined: &RefinedCamera) -> Self {
        let mut history = self.clone();
        apply_poses(&mut history.keyframes, &refined.keyframes);
        history.solved = refined.frames.iter().copied().collect();
        history
    }

    /// The submaps, and which of them are joined.
    pub fn submaps(&self) -> &Submaps {
        &self.submaps
    }

    /// The component of a keyframe: keyframes of one component alone have a common frame.
    pub fn component_of_keyframe(&self, id: u32) -> Option<u32> {
        self.keyframes.get(id as usize).map(|k| self.submaps.component(k.submap))
    }

    /// The component of a frame: that of its reference keyframe, which its final pose follows.
    pub fn component_of_frame(&self, frame: &FrameRecord) -> u32 {
        let of_keyframe = self.component_of_keyframe(frame.pose.keyframe);
        of_keyframe.unwrap_or_else(|| self.submaps.component(frame.submap))
    }

    /// Number of keyframes, those of earlier runs included.
    pub fn n_keyframes(&self) -> usize {
        self.keyframes.len()
    }

    /// Corrected `world_from_camera` of a keyframe.
    pub fn keyframe_pose(&self, id: u32) -> Option<Pose> {
        self.keyframes.get(id as usize).map(|k| Pose::from(&k.world_from_camera))
    }

    /// Corrected `world_from_camera` of all keyframes, by id.
    pub fn keyframe_poses(&self) -> impl Iterator<Item = Pose> + '_ {
        self.keyframes.iter().map(|k| Pose::from(&k.world_from_camera))
    }

    /// Final `world_from_camera` of a frame. In this order: as solved again by the last correction;
    /// the pose of the keyframe that it became; its reference keyframe times its relative pose; as
    /// first published, where it has no reference keyframe.
    pub fn final_pose(&self, frame: &FramePose) -> Pose {
        if let Some(solved) = self.solved.get(&frame.index) {
            return Pose::from(solved);
        }
        if let Some(pose) = self.keyframe_of_frame.get(&frame.index).and_then(|&id| self.keyframe_pose(id)) {
            return pose;
        }
        match self.keyframe_pose(frame.keyframe) {
            Some(world_from_keyframe) => world_from_keyframe * Pose::from(&frame.keyframe_from_camera),
            None => Pose::from(&frame.world_from_camera),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::keyframe::KeyframePose;

    fn along_x(x_m: f64) -> PoseBits {
        PoseBits::from(&Pose::translation(x_m, 0.0, 0.0))
    }

    fn correction(keyframes: &[(u32, f64)], frames: &[(u64, f64)]) -> Correction {
        let pose = |(id, x): &(u32, f64)| KeyframePose { id: *id, world_from_camera: along_x(*x) };
        Correction {
            keyframes: keyframes.iter().map(pose).collect(),
            frames: frames.iter().map(|(index, x)| (*index, along_x(*x))).collect(),
            ..Correction::default()
        }
    }

    fn placement(submap: u32, x_m: f64) -> Placement {
        Placement { submap, world_from_camera: along_x(x_m), anchored_to: None }
    }

    /// Keyframes 0, 1, 2 at 0, 1 and 2 m, made from frames 0, 10 and 20.
    fn history() -> PoseHistory {
        PoseHistory {
            keyframes: [0.0, 1.0, 2.0].map(|x| placement(0, x)).to_vec(),
            submaps: Submaps::default(),
            keyframe_of_frame: [(0, 0), (10, 1), (20, 2)].into(),
            solved: BTreeMap::new(),
        }
    }

    fn check(history: &PoseHistory, index: u64, keyframe: u32, expected_x_m: f64) {
        let frame = FramePose {
            index,
            keyframe,
            keyframe_from_camera: along_x(0.25),
            world_from_camera: along_x(9.0),
        };
        assert_eq!(history.final_pose(&frame).translation.x, expected_x_m, "frame {index}");
    }

    #[test]
    fn a_frame_follows_its_keyframe_and_a_frame_that_became_one_is_that_keyframe() {
        let mut history = history();
        history.apply_correction(&correction(&[(0, 0.0), (1, 4.0)], &[]));
        check(&history, 5, 0, 0.25);
        check(&history, 10, 0, 4.0);
        check(&history, 15, 1, 4.25);
        check(&history, 25, 2, 5.25);
        check(&history, 3, u32::MAX, 9.0);
    }

    #[test]
    fn solved_frames_are_those_of_the_last_correction_that_corrected() {
        let mut history = history();
        history.apply_correction(&correction(&[(0, 0.0)], &[(5, 7.0)]));
        check(&history, 5, 0, 7.0);
        history.apply_correction(&correction(&[], &[]));
        check(&history, 5, 0, 7.0);
        history.apply_correction(&correction(&[(0, 0.5)], &[]));
        check(&history, 5, 0, 0.75);
    }
}
