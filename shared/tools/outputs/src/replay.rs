//! The aligner's journal read back: every frame with its final pose, every keyframe, every loop.

use std::collections::BTreeMap;
use tessera_geometry::Pose;
use tessera_slam::{
    AlignRecord, ColourModel, ColourState, Correction, FrameRecord, KeyframeRecord, KeyframeState,
    LoopRecord, LoopVerdict, MapRecord, PoseHistory, RefinedCamera, Refinement, SkippedFrames, State,
    Submaps,
};
use tessera_surface::WorkloadLevel;

/// Loops that the optimiser left with less weight than this do not count as closed.
const LOOP_WEIGHT: f64 = 0.5;

/// A fold over the aligner's journal.
#[derive(Clone, Debug, Default)]
pub struct Replay {
    /// Processed frames in order.
    pub frames: Vec<FrameRecord>,
    /// Frames left out in live mode, in order.
    pub skipped: Vec<SkippedFrames>,
    /// Keyframes by id, as they were made.
    pub keyframes: Vec<KeyframeRecord>,
    /// Keyframes of the map of earlier runs: the first of `keyframes`.
    pub n_map_keyframes: usize,
    /// The run that made each of them.
    map_sessions: Vec<u32>,
    /// The first frame that was tracked.
    pub first_tracked: Option<u64>,
    /// Poses of keyframes and frames with all corrections.
    poses: PoseHistory,
    /// For each processed frame the component that its pose was published in: what is joined later was
    /// another world frame then.
    online_gauges: Vec<u32>,
    /// What the final optimisation made of the camera, where it was asked to.
    pub refinement: Option<Refinement>,
    /// Corrections that took effect.
    pub n_corrections: u64,
    /// Frames in the source, once it is exhausted.
    pub n_source_frames: Option<u64>,
    /// Whether a correction took effect after the end of the source.
    pub is_finally_optimised: bool,
    /// What the optimiser last said of each loop, by newer and older keyframe.
    pub loops: BTreeMap<(u32, u32), LoopRecord>,
}

impl Replay {
    /// The earlier run that a keyframe of its map is of; `None` of one of this run.
    pub fn earlier_run(&self, keyframe: u32) -> Option<usize> {
        self.map_sessions.get(keyframe as usize).map(|session| *session as usize)
    }

    /// Takes the next record in.
    pub fn apply(&mut self, record: AlignRecord) {
        if let AlignRecord::Frame(frame) = &record {
            // Before the record takes effect: a join stands behind its frame.
            self.online_gauges.push(self.submaps().component(frame.submap));
        }
        self.poses.apply(&record);
        match record {
            AlignRecord::Map(map) => self.add_map(*map),
            AlignRecord::Frame(mut frame) => {
                if frame.state == State::Tracking {
                    self.first_tracked.get_or_insert(frame.index);
                }
                if let Some(keyframe) = frame.change.new_keyframe.take() {
                    self.keyframes.push(keyframe);
                }
                // The tracker's own memory is of no use here, and large.
                frame.evidence.blocks = Vec::new();
                self.frames.push(*frame);
            }
            AlignRecord::Skipped(skipped) => self.skipped.push(skipped),
            AlignRecord::Correction(applied) => self.correct(&applied.correction),
            AlignRecord::End { n_frames, .. } => self.n_source_frames = Some(n_frames),
        }
    }

    fn add_map(&mut self, map: MapRecord) {
        self.n_map_keyframes = map.keyframes.len();
        self.map_sessions = map.keyframes.iter().map(|keyframe| keyframe.session).collect();
        for keyframe in map.keyframes {
            // What place it is matters to the tracker alone.
            let KeyframeState { id, frame_index, stamp_nanos, world_from_camera, velocity, slot, .. } =
                keyframe;
            let (edges, place) = (Vec::new(), Vec::new());
            self.keyframes.push(KeyframeRecord {
                id,
                frame_index,
                stamp_nanos,
                world_from_camera,
                velocity,
                slot,
                edges,
                place,
                alike: Vec::new(),
                retires: Vec::new(),
            });
        }
    }

    fn correct(&mut self, correction: &Correction) {
        // The answer to a request that was left out corrects nothing.
        if !correction.keyframes.is_empty() {
            self.n_corrections = self.n_corrections.saturating_add(1);
            self.is_finally_optimised |= self.n_source_frames.is_some();
        }
        self.refinement.clone_from(&correction.refinement);
        for pair in &correction.loops {
            self.loops.insert((pair.newer, pair.older), *pair);
        }
    }

    /// The refined camera, where there is one.
    pub fn refined(&self) -> Option<&RefinedCamera> {
        match &self.refinement {
            Some(Refinement::Refined(refined)) => Some(refined),
            _ => None,
        }
    }

    /// The same run as the refined camera saw it; `None` where no camera was refined.
    pub fn with_refined_camera(&self) -> Option<Self> {
        let poses = self.poses.with_refined_camera(self.refined()?);
        Some(Self { poses, ..self.clone() })
    }

    /// The submaps, and which of them are joined.
    pub fn submaps(&self) -> &Submaps {
        self.poses.submaps()
    }

    /// The component of submaps that a frame is in: frames of one component alone have a common frame.
    pub fn component(&self, frame: &FrameRecord) -> u32 {
        self.poses.component_of_frame(frame)
    }

    /// For each processed frame the gauge of its pose as first published.
    pub(crate) fn online_gauges(&self) -> &[u32] {
        &self.online_gauges
    }

    /// Processed frames of each component, and those of them that were tracked.
    pub(crate) fn n_by_component(&self) -> BTreeMap<u32, (u64, u64)> {
        let mut counts = BTreeMap::new();
        for frame in &self.frames {
            let (n, n_tracked): &mut (u64, u64) = counts.entry(self.component(frame)).or_default();
            *n = n.saturating_add(1);
            *n_tracked = n_tracked.saturating_add(u64::from(frame.state == State::Tracking));
        }
        counts
    }

    /// The component with most tracked frames, the older of two: what the outputs are of.
    pub fn main_component(&self) -> u32 {
        let counts = self.n_by_component();
        let most = counts.iter().rev().max_by_key(|(_, (_, n_tracked))| *n_tracked);
        most.map_or(0, |(component, _)| *component)
    }

    /// Processed frames of each component but the main one.
    pub fn apart(&self) -> BTreeMap<u32, u64> {
        let main = self.main_component();
        let counts = self.n_by_component().into_iter().filter(|(component, _)| *component != main);
        counts.map(|(component, (n, _))| (component, n)).collect()
    }

    /// What all frames say of colour against depth, from what the camera file states on.
    pub fn colour(&self, stated: ColourModel) -> ColourState {
        ColourState::of_records(stated, self.frames.iter().map(|frame| frame.evidence.of_camera()))
    }

    /// The keyframes of the main component, each with its corrected `world_from_camera`.
    pub fn main_keyframes(&self) -> impl Iterator<Item = (&KeyframeRecord, Pose)> {
        self.keyframes_of(self.main_component())
    }

    /// The keyframes of a component, each with its corrected `world_from_camera`.
    pub fn keyframes_of(&self, component: u32) -> impl Iterator<Item = (&KeyframeRecord, Pose)> {
        let keyframes = self.keyframes.iter().zip(self.keyframe_poses());
        keyframes.filter(move |(k, _)| self.poses.component_of_keyframe(k.id) == Some(component))
    }

    /// Corrected `world_from_camera` of each keyframe, by id.
    pub fn keyframe_poses(&self) -> impl Iterator<Item = Pose> + '_ {
        self.poses.keyframe_poses()
    }

    /// Final `world_from_camera` of a frame.
    pub fn final_pose(&self, frame: &FrameRecord) -> Pose {
        self.poses.final_pose(&frame.into())
    }

    /// Loops found: pairs of keyframes that the optimiser judged, and those of the aligner that it had
    /// no word on.
    pub fn n_loops_found(&self) -> u64 {
        self.loops.keys().copied().chain(self.unjudged_loops()).count() as u64
    }

    /// Loops closed: verified, and kept by the optimiser.
    pub fn n_loops_closed(&self) -> u64 {
        self.verified_loops().iter().filter(|(_, _, is_closed)| *is_closed).count() as u64
    }

    /// Loops that were verified and then rejected by the optimiser, for they contradict the others.
    pub fn n_loops_rejected(&self) -> u64 {
        self.loops.values().filter(|pair| is_verified(pair) && is_rejected(pair)).count() as u64
    }

    /// Verified loops: newer and older keyframe, and whether the loop was closed, or rejected by the optimiser.
    pub fn verified_loops(&self) -> Vec<(u32, u32, bool)> {
        let judged = self.loops.values().filter(|pair| is_verified(pair));
        let judged = judged.map(|pair| (pair.newer, pair.older, !is_rejected(pair)));
        let mut all: Vec<_> = judged.chain(self.unjudged_loops().map(|(a, b)| (a, b, true))).collect();
        all.sort_unstable();
        all
    }

    /// Loops of the aligner, which verified them, that the optimiser did not judge.
    fn unjudged_loops(&self) -> impl Iterator<Item = (u32, u32)> {
        let edges = self.keyframes.iter().flat_map(|k| k.edges.iter().map(move |edge| (k.id, edge)));
        let loops = edges.filter(|(_, edge)| edge.is_loop).map(|(newer, edge)| (newer, edge.to));
        loops.filter(|pair| !self.loops.contains_key(pair))
    }

    /// Frames by the workload they got, from the full one down.
    pub fn n_at_workload(&self) -> [u64; 4] {
        WorkloadLevel::ALL.map(|level| self.frames.iter().filter(|f| f.workload == level).count() as u64)
    }

    /// Frames left out in live mode.
    pub fn n_skipped(&self) -> u64 {
        self.skipped.iter().fold(0, |n, skipped| n.saturating_add(skipped.n()))
    }

    /// Frames whose pose cannot be trusted.
    pub fn n_untracked(&self) -> u64 {
        self.frames.iter().filter(|frame| frame.state != State::Tracking).count() as u64
    }
}

fn is_verified(pair: &LoopRecord) -> bool {
    matches!(pair.verdict, LoopVerdict::Accepted | LoopVerdict::Outvoted)
}

fn is_rejected(pair: &LoopRecord) -> bool {
    pair.verdict == LoopVerdict::Outvoted || pair.weight < LOOP_WEIGHT
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run;

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
        assert_eq!((replay.n_loops_found(), replay.n_loops_closed(), replay.n_loops_rejected()), (2, 1, 1));
        let loops = replay.verified_loops();
        let n_closed = loops.iter().filter(|(.., is_closed)| *is_closed).count();
        assert_eq!((loops.len(), n_closed), (2, 1));
        assert_eq!(replay.n_untracked(), 1);
        assert_eq!((replay.skipped.len(), replay.n_skipped()), (1, 1));
        assert_eq!(replay.skipped[0].frames, 6..7);
        assert_eq!(replay.n_source_frames, Some(7));
        assert!(!replay.is_finally_optimised);
    }
}
