//! The aligner's journal read back: every frame with its final pose, every keyframe, every loop.

use std::collections::BTreeMap;
use tessera_geometry::{Pose, PoseBits};
use tessera_mapping::{
    AlignRecord, Correction, FrameRecord, KeyframeRecord, KeyframeState, LoopRecord, MapRecord,
    RefinedCamera, Refinement, State,
};

/// Loops that the optimiser left with less weight than this do not count as closed.
const LOOP_WEIGHT: f64 = 0.5;

/// A fold over the aligner's journal.
#[derive(Clone, Debug, Default)]
pub(crate) struct Replay {
    /// Processed frames in order.
    pub(crate) frames: Vec<FrameRecord>,
    /// Frames left out in live mode: index and reason.
    pub(crate) skipped: Vec<(u64, String)>,
    /// Keyframes by id, as they were made.
    pub(crate) keyframes: Vec<KeyframeRecord>,
    /// Keyframes of the map of earlier runs: the first of `keyframes`.
    pub(crate) n_map_keyframes: usize,
    /// The first frame that was tracked.
    pub(crate) first_tracked: Option<u64>,
    /// Corrected `world_from_camera` of each keyframe, by id.
    pub(crate) keyframe_poses: Vec<Pose>,
    /// What the final optimisation made of the camera, where it was asked to.
    pub(crate) refinement: Option<Refinement>,
    /// Corrections that took effect.
    pub(crate) n_corrections: u64,
    /// Frames in the source, once it is exhausted.
    pub(crate) n_source_frames: Option<u64>,
    /// Whether a correction took effect after the end of the source.
    pub(crate) is_finally_optimised: bool,
    /// `world_from_camera` of frames that the final optimisation solved again.
    solved: BTreeMap<u64, PoseBits>,
    /// What the optimiser last said of each loop, by newer and older keyframe.
    pub(crate) loops: BTreeMap<(u32, u32), LoopRecord>,
    /// Which keyframe a frame became.
    keyframe_of_frame: BTreeMap<u64, u32>,
}

impl Replay {
    /// Takes the next record in.
    pub(crate) fn apply(&mut self, record: AlignRecord) {
        match record {
            AlignRecord::Map(map) => self.add_map(*map),
            AlignRecord::Frame(mut frame) => {
                if frame.state == State::Tracking {
                    self.first_tracked.get_or_insert(frame.index);
                }
                if let Some(keyframe) = frame.new_keyframe.take() {
                    self.add_keyframe(keyframe);
                }
                for moved in &frame.moved {
                    if let Some(pose) = self.keyframe_poses.get_mut(moved.id as usize) {
                        *pose = Pose::from(&moved.world_from_camera);
                    }
                }
                // The tracker's own memory is of no use here, and large.
                frame.blocks = Vec::new();
                self.frames.push(*frame);
            }
            AlignRecord::Skipped(index, reason) => self.skipped.push((index, reason)),
            AlignRecord::Correction(applied) => self.correct(&applied.correction),
            AlignRecord::End { n_frames, .. } => self.n_source_frames = Some(n_frames),
        }
    }

    fn add_map(&mut self, map: MapRecord) {
        self.n_map_keyframes = map.keyframes.len();
        for keyframe in map.keyframes {
            // What place it is matters to the tracker alone.
            let KeyframeState { id, frame_index, stamp_nanos, world_from_camera, velocity, slot, .. } =
                keyframe;
            let (edges, place) = (Vec::new(), Vec::new());
            self.keyframe_poses.push(Pose::from(&world_from_camera));
            self.keyframes.push(KeyframeRecord {
                id,
                frame_index,
                stamp_nanos,
                world_from_camera,
                velocity,
                slot,
                edges,
                place,
                retires: Vec::new(),
            });
        }
    }

    fn add_keyframe(&mut self, keyframe: KeyframeRecord) {
        self.keyframe_of_frame.insert(keyframe.frame_index, keyframe.id);
        self.keyframe_poses.push(Pose::from(&keyframe.world_from_camera));
        self.keyframes.push(keyframe);
    }

    /// Moves the keyframes; those made since the request was answered hang on the last of it.
    fn correct(&mut self, correction: &Correction) {
        // The answer to a request that was left out corrects nothing.
        if !correction.keyframes.is_empty() {
            self.n_corrections += 1;
            self.is_finally_optimised |= self.n_source_frames.is_some();
        }
        let mut new_from_old = None;
        let mut n_corrected = 0;
        for corrected in &correction.keyframes {
            let Some(pose) = self.keyframe_poses.get_mut(corrected.id as usize) else { continue };
            let new = Pose::from(&corrected.world_from_camera);
            new_from_old = Some(new * pose.inverse());
            *pose = new;
            n_corrected = n_corrected.max(corrected.id as usize + 1);
        }
        if let Some(new_from_old) = new_from_old {
            for pose in self.keyframe_poses.iter_mut().skip(n_corrected) {
                *pose = new_from_old * *pose;
            }
        }
        self.solved.extend(correction.frames.iter().copied());
        self.refinement.clone_from(&correction.refinement);
        for pair in &correction.loops {
            self.loops.insert((pair.newer, pair.older), *pair);
        }
    }

    /// The refined camera, where there is one.
    pub(crate) fn refined(&self) -> Option<&RefinedCamera> {
        match &self.refinement {
            Some(Refinement::Refined(refined)) => Some(refined),
            _ => None,
        }
    }

    /// The same run as the refined camera saw it; `None` where no camera was refined.
    pub(crate) fn with_refined_camera(&self) -> Option<Self> {
        let refined = self.refined()?;
        let mut replay = self.clone();
        for keyframe in &refined.keyframes {
            if let Some(pose) = replay.keyframe_poses.get_mut(keyframe.id as usize) {
                *pose = Pose::from(&keyframe.world_from_camera);
            }
        }
        replay.solved.extend(refined.frames.iter().copied());
        Some(replay)
    }

    /// The final `world_from_camera` of a frame: solved again, or a keyframe itself, or hanging on
    /// its keyframe by the pose that was journaled.
    pub(crate) fn final_pose(&self, frame: &FrameRecord) -> Pose {
        if let Some(solved) = self.solved.get(&frame.index) {
            return Pose::from(solved);
        }
        if let Some(pose) = self.keyframe_of_frame.get(&frame.index).and_then(|&id| self.keyframe_pose(id)) {
            return pose;
        }
        match self.keyframe_pose(frame.keyframe) {
            Some(world_from_keyframe) => world_from_keyframe * Pose::from(&frame.keyframe_from_camera),
            // Before the first keyframe there is nothing to hang on.
            None => Pose::from(&frame.world_from_camera),
        }
    }

    fn keyframe_pose(&self, id: u32) -> Option<Pose> {
        self.keyframe_poses.get(id as usize).copied()
    }

    /// Loops between keyframes that the optimiser kept.
    pub(crate) fn n_loops_closed(&self) -> u64 {
        let weight = |newer, older| self.loops.get(&(newer, older)).map_or(1.0, |pair| pair.weight);
        let loops = self.keyframes.iter().flat_map(|k| k.edges.iter().map(move |edge| (k.id, edge)));
        loops.filter(|(newer, edge)| edge.is_loop && weight(*newer, edge.to) >= LOOP_WEIGHT).count() as u64
    }

    /// Frames by the effort they got, from the full one down.
    pub(crate) fn n_at_effort(&self) -> [u64; 4] {
        let mut counts = [0; 4];
        self.frames.iter().for_each(|frame| counts[frame.effort.rung()] += 1);
        counts
    }

    /// Frames whose pose cannot be trusted.
    pub(crate) fn n_untracked(&self) -> u64 {
        self.frames.iter().filter(|frame| frame.state != State::Tracking).count() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outputs::test_run;

    #[test]
    fn frames_follow_their_corrected_keyframe() {
        let mut replay = Replay::default();
        test_run::records().into_iter().for_each(|record| replay.apply(record));
        assert_eq!((replay.frames.len(), replay.keyframes.len(), replay.n_corrections), (6, 3, 1));
        // The correction moves keyframe 1 by 1 m along x; keyframe 2, made later, moves with it.
        let x: Vec<f64> = replay.frames.iter().map(|f| replay.final_pose(f).translation.x).collect();
        assert_eq!(x, [0.0, 0.1, 1.2, 1.3, 1.4, 7.0]);
    }

    #[test]
    fn counts_say_what_happened() {
        let mut replay = Replay::default();
        test_run::records().into_iter().for_each(|record| replay.apply(record));
        assert_eq!(replay.n_loops_closed(), 1);
        assert_eq!(replay.n_untracked(), 1);
        assert_eq!(replay.skipped, [(6, "newer frames had come".to_owned())]);
        assert_eq!(replay.n_source_frames, Some(7));
        assert!(!replay.is_finally_optimised);
    }
}
