//! Effect of corrections on poses: the one fold that gives final poses (method 8.4).
//!
//! A correction names keyframes `0..=last`. They take their corrected poses; every pose that was
//! estimated after the request moves rigidly with the last of them that its submap has. A join moves
//! all poses of one component into the gauge of another. The tracker's state uses these
//! functions for its keyframes and recent frames, and [`PoseHistory`] for a whole run, so the
//! outputs, the offline runner and the viewer have the poses that the tracker went on with.

use crate::map::correction::{Correction, RefinedCamera};
use crate::map::keyframe::{KeyframePose, KeyframeRecord, KeyframeState};
use crate::map::records::{AlignRecord, FrameRecord, JoinRecord, SplitRecord};
use crate::map::submaps::Submaps;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use tessera_geometry::{Pose, PoseBits, Twist, compose_normalised};

/// Storage of keyframe poses `world_from_camera`, indexed by id.
pub(crate) trait KeyframePoses {
    /// Pose of a keyframe, `None` beyond the last.
    fn pose_mut(&mut self, id: usize) -> Option<&mut PoseBits>;

    /// The submap that a keyframe was made in, `None` beyond the last.
    fn submap(&self, id: usize) -> Option<u32>;

    /// The same, to be changed.
    fn submap_mut(&mut self, id: usize) -> Option<&mut u32>;
}

impl KeyframePoses for [KeyframeState] {
    fn pose_mut(&mut self, id: usize) -> Option<&mut PoseBits> {
        self.get_mut(id).map(|keyframe| &mut keyframe.world_from_camera)
    }

    fn submap(&self, id: usize) -> Option<u32> {
        self.get(id).map(|keyframe| keyframe.submap)
    }

    fn submap_mut(&mut self, id: usize) -> Option<&mut u32> {
        self.get_mut(id).map(|keyframe| &mut keyframe.submap)
    }
}

impl KeyframePoses for [(u32, PoseBits)] {
    fn pose_mut(&mut self, id: usize) -> Option<&mut PoseBits> {
        self.get_mut(id).map(|(_, pose)| pose)
    }

    fn submap(&self, id: usize) -> Option<u32> {
        self.get(id).map(|(submap, _)| *submap)
    }

    fn submap_mut(&mut self, id: usize) -> Option<&mut u32> {
        self.get_mut(id).map(|(submap, _)| submap)
    }
}

/// Rigid motion in the world, `new_world_from_old_world`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RigidMotion(pub(crate) Pose);

impl RigidMotion {
    /// The motion that takes one pose to another.
    pub(crate) fn between(old: &PoseBits, new: &PoseBits) -> Self {
        Self(Pose::from(new) * Pose::from(old).inverse())
    }

    /// The moved pose, its quaternion normalised.
    pub(crate) fn of(&self, world_from_camera: &PoseBits) -> PoseBits {
        let moved = self.0 * Pose::from(world_from_camera);
        PoseBits::from(&compose_normalised(&moved, &Twist::default()))
    }
}

/// Sets the poses of single keyframes.
pub(crate) fn apply_poses<K: KeyframePoses + ?Sized>(keyframes: &mut K, poses: &[KeyframePose]) {
    for KeyframePose { id, world_from_camera } in poses {
        if let Some(pose) = keyframes.pose_mut(*id as usize) {
            *pose = *world_from_camera;
        }
    }
}

/// Motions of what was estimated after a request, by submap; what lies in others does not move.
pub(crate) type Motions = BTreeMap<u32, RigidMotion>;

/// Applies a correction to the keyframes and returns the motions of everything estimated after the
/// request; `None` where the correction is empty, as that of a declined request.
pub(crate) fn apply_correction<K: KeyframePoses + ?Sized>(
    keyframes: &mut K,
    correction: &Correction,
) -> Option<Motions> {
    let last = correction.keyframes.last()?;
    let mut motions = Motions::new();
    for KeyframePose { id, world_from_camera } in correction.keyframes.iter().rev() {
        let submap = keyframes.submap(*id as usize)?;
        if let Entry::Vacant(vacant) = motions.entry(submap) {
            let old = keyframes.pose_mut(*id as usize)?;
            vacant.insert(RigidMotion::between(old, world_from_camera));
        }
    }
    let mut id = last.id as usize + 1;
    while let Some(submap) = keyframes.submap(id) {
        if let (Some(pose), Some(motion)) = (keyframes.pose_mut(id), motions.get(&submap)) {
            *pose = motion.of(pose);
        }
        id += 1;
    }
    apply_poses(keyframes, &correction.keyframes);
    Some(motions)
}

/// Puts the keyframes of a split into their submaps, of which the last one is `submap`: their poses stay as
/// they are.
pub(crate) fn apply_split<K: KeyframePoses + ?Sized>(keyframes: &mut K, split: &SplitRecord, submap: u32) {
    let firsts: Vec<u32> = split.firsts().collect();
    for (first, back) in firsts.iter().zip((0..firsts.len() as u32).rev()) {
        let mut id = *first as usize;
        while let Some(own) = keyframes.submap_mut(id) {
            *own = submap.saturating_sub(back);
            id += 1;
        }
    }
}

/// Moves one component's keyframes into the gauge of another, makes one of both, and returns the
/// motion.
pub(crate) fn apply_join<K: KeyframePoses + ?Sized>(
    keyframes: &mut K,
    submaps: &mut Submaps,
    join: &JoinRecord,
) -> RigidMotion {
    let motion = RigidMotion(Pose::from(&join.kept_from_moved));
    let mut id = 0;
    while let Some(submap) = keyframes.submap(id) {
        if submaps.component(submap) == join.moved
            && let Some(pose) = keyframes.pose_mut(id)
        {
            *pose = motion.of(pose);
        }
        id += 1;
    }
    submaps.join(join.kept, join.moved);
    motion
}

/// Where a frame's pose comes from: the part of its record that its final pose needs.
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
            keyframe: frame.keyframe,
            keyframe_from_camera: frame.keyframe_from_camera,
            world_from_camera: frame.world_from_camera,
        }
    }
}

/// Poses of all keyframes, and what the final pose of each frame needs beside its record: a fold
/// over the aligner's journal.
#[derive(Clone, Debug, Default)]
pub struct PoseHistory {
    /// The submap and `world_from_camera` as corrected so far, by id.
    keyframes: Vec<(u32, PoseBits)>,
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
                self.keyframes.extend(map.keyframes.iter().map(|k| (k.submap, k.world_from_camera)));
                self.submaps.clone_from(&map.submaps);
            }
            AlignRecord::Frame(frame) => {
                apply_poses(self.keyframes.as_mut_slice(), &frame.moved);
                self.submaps.extend_to(frame.submap);
                if let Some(keyframe) = &frame.new_keyframe {
                    self.add_keyframe(keyframe, frame.submap);
                }
                if let Some(split) = &frame.split {
                    apply_split(self.keyframes.as_mut_slice(), split, frame.submap);
                }
                if let Some(join) = &frame.join {
                    apply_join(self.keyframes.as_mut_slice(), &mut self.submaps, join);
                }
            }
            AlignRecord::Correction(applied) => self.apply_correction(&applied.correction),
            AlignRecord::Skipped(..) | AlignRecord::End { .. } => {}
        }
    }

    fn add_keyframe(&mut self, keyframe: &KeyframeRecord, submap: u32) {
        self.keyframe_of_frame.insert(keyframe.frame_index, keyframe.id);
        self.keyframes.push((submap, keyframe.world_from_camera));
    }

    /// Frames solved against poses that have moved since are no longer solved.
    fn apply_correction(&mut self, correction: &Correction) {
        if apply_correction(self.keyframes.as_mut_slice(), correction).is_some() {
            self.solved = correction.frames.iter().copied().collect();
            self.submaps.judge(&correction.submaps);
        }
    }

    /// The same run with the poses that go with a refined camera.
    pub fn with_refined_camera(&self, refined: &RefinedCamera) -> Self {
        let mut history = self.clone();
        apply_poses(history.keyframes.as_mut_slice(), &refined.keyframes);
        history.solved = refined.frames.iter().copied().collect();
        history
    }

    /// The submaps, and which of them are joined.
    pub fn submaps(&self) -> &Submaps {
        &self.submaps
    }

    /// The component of a keyframe: keyframes of one component alone have a common frame.
    pub fn component_of_keyframe(&self, id: u32) -> Option<u32> {
        self.keyframes.get(id as usize).map(|(submap, _)| self.submaps.component(*submap))
    }

    /// The component of a frame: that of its reference keyframe, which its final pose follows.
    pub fn component_of_frame(&self, frame: &FrameRecord) -> u32 {
        let of_keyframe = self.component_of_keyframe(frame.keyframe);
        of_keyframe.unwrap_or_else(|| self.submaps.component(frame.submap))
    }

    /// Number of keyframes, those of earlier runs included.
    pub fn n_keyframes(&self) -> usize {
        self.keyframes.len()
    }

    /// Corrected `world_from_camera` of a keyframe.
    pub fn keyframe_pose(&self, id: u32) -> Option<Pose> {
        self.keyframes.get(id as usize).map(|(_, pose)| Pose::from(pose))
    }

    /// Corrected `world_from_camera` of all keyframes, by id.
    pub fn keyframe_poses(&self) -> impl Iterator<Item = Pose> + '_ {
        self.keyframes.iter().map(|(_, pose)| Pose::from(pose))
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

    fn along_x(x_m: f64) -> PoseBits {
        PoseBits::from(&Pose::translation(x_m, 0.0, 0.0))
    }

    fn correction(keyframes: &[(u32, f64)], frames: &[(u64, f64)]) -> Correction {
        let pose = |(id, x): &(u32, f64)| KeyframePose { id: *id, world_from_camera: along_x(*x) };
        Correction {
            request: 0,
            input_hash: 0,
            keyframes: keyframes.iter().map(pose).collect(),
            frames: frames.iter().map(|(index, x)| (*index, along_x(*x))).collect(),
            loops: Vec::new(),
            submaps: Submaps::default(),
            outer_iterations: 1,
            n_graduated_rounds: 0,
            refinement: None,
        }
    }

    /// Keyframes 0, 1, 2 at 0, 1 and 2 m, made from frames 0, 10 and 20.
    fn history() -> PoseHistory {
        PoseHistory {
            keyframes: [0.0, 1.0, 2.0].map(|x| (0, along_x(x))).to_vec(),
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
    fn a_submap_moves_with_its_own_keyframes_and_at_a_join() {
        // Keyframes 0 and 2 are of submap 0, 1 and 3 of submap 1.
        let mut history = PoseHistory {
            keyframes: [(0, 0.0), (1, 1.0), (0, 2.0), (1, 3.0)].map(|(s, x)| (s, along_x(x))).to_vec(),
            ..PoseHistory::default()
        };
        history.submaps.extend_to(1);
        let x = |history: &PoseHistory| -> Vec<f64> {
            history.keyframe_poses().map(|pose| pose.translation.x).collect()
        };
        history.apply_correction(&correction(&[(0, 0.5), (1, 5.0)], &[]));
        assert_eq!(x(&history), [0.5, 5.0, 2.5, 7.0]);
        let join = JoinRecord { kept: 0, moved: 1, kept_from_moved: along_x(10.0) };
        apply_join(history.keyframes.as_mut_slice(), &mut history.submaps, &join);
        assert_eq!(x(&history), [0.5, 15.0, 2.5, 17.0]);
        assert_eq!(history.component_of_keyframe(3), Some(0));
        history.apply_correction(&correction(&[], &[]));
        assert_eq!(history.submaps.n_components(), 1, "an empty correction judges nothing");
    }

    #[test]
    fn a_split_gives_the_latest_keyframes_to_new_submaps() {
        let mut keyframes = [0, 0, 0, 0, 0].map(|submap| (submap, along_x(1.0)));
        apply_split(keyframes.as_mut_slice(), &SplitRecord { carried: None, first: 4 }, 1);
        assert_eq!(keyframes.map(|(submap, _)| submap), [0, 0, 0, 0, 1]);
        apply_split(keyframes.as_mut_slice(), &SplitRecord { carried: Some(1), first: 3 }, 3);
        assert_eq!(keyframes.map(|(submap, _)| submap), [0, 2, 2, 3, 3]);
        assert!(keyframes.iter().all(|(_, pose)| *pose == along_x(1.0)));
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
