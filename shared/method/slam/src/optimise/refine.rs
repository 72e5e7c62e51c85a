//! A frame solved again against optimised keyframes, from its journaled blocks (method 5.3, method 8).

use crate::map::records::{AlignRecord, FrameRecord};
use crate::map::state::KeyframeState;
use crate::map::submaps::Submaps;
use crate::optimise::interpolation::PoseTimeline;
use crate::pairs::match_cache::has_left;
use rayon::prelude::*;
use std::collections::BTreeMap;
use tessera_geometry::{Pose, PoseBits};
use tessera_graph::{Graph, INNER_ITERATIONS, Pair, PairBlock};

/// The frames of a run as they were journaled, read again when they are needed: they are too many
/// to be kept.
pub trait FrameHistory {
    /// Hands the records of all frames over, in order.
    fn visit(&self, take: &mut dyn FnMut(&FrameRecord));
}

impl FrameHistory for &[AlignRecord] {
    fn visit(&self, take: &mut dyn FnMut(&FrameRecord)) {
        for record in *self {
            if let AlignRecord::Frame(frame) = record {
                take(frame);
            }
        }
    }
}

/// What is needed of a frame to solve it again.
#[derive(Clone, Debug)]
pub(crate) struct FrameBlocks {
    pub(crate) index: u64,
    keyframe: u32,
    keyframe_from_camera: PoseBits,
    blocks: Vec<(u32, PairBlock)>,
}

impl FrameBlocks {
    pub(crate) fn of(frame: &FrameRecord) -> Option<Self> {
        let blocks: Vec<_> =
            frame.evidence.blocks.iter().filter_map(|b| Some((b.keyframe, b.pair_block()?))).collect();
        (!blocks.is_empty()).then_some(Self {
            index: frame.index,
            keyframe: frame.pose.keyframe,
            keyframe_from_camera: frame.pose.keyframe_from_camera,
            blocks,
        })
    }

    /// The pose that fits all blocks best, keyframes fixed; that by the reference keyframe alone where the blocks
    /// put the frame farther away than it can have been wrong. `None` when they do not determine it. Only blocks
    /// with keyframes `in_common` with the reference keyframe count.
    pub(crate) fn solve(
        &self,
        keyframe_poses: &[Pose],
        in_common: impl Fn(u32, u32) -> bool,
    ) -> Option<Pose> {
        let start = keyframe_poses.get(self.keyframe as usize)? * Pose::from(&self.keyframe_from_camera);
        let mut graph = Graph::default();
        let blocks: Vec<_> = self.blocks.iter().filter(|block| in_common(block.0, self.keyframe)).collect();
        let frame = blocks.len();
        for (keyframe, block) in blocks {
            let target = graph.poses.len();
            graph.poses.push(*keyframe_poses.get(*keyframe as usize)?);
            graph.is_fixed.push(true);
            graph.pairs.push(Pair::new(frame, target, block.clone()));
        }
        graph.poses.push(start);
        graph.is_fixed.push(false);
        graph.optimise(INNER_ITERATIONS, &mut || ()).ok()?;
        let found = graph.poses.pop()?;
        // Where keyframes have moved against each other, two walls of a corridor that were parallel meet, far away.
        Some(if has_left(&start, &found) { start } else { found })
    }
}

/// Frames that are solved at once: what is read of a history at a time.
const CHUNK: usize = 1024;

/// What solving frames again needs to know.
pub(crate) struct Refiner<'a> {
    /// Poses of the keyframes, by id.
    pub(crate) poses: &'a [Pose],
    /// Keyframes of earlier runs, which come first and count other frames.
    pub(crate) n_map_keyframes: usize,
    /// All keyframes, by id.
    pub(crate) keyframes: &'a [KeyframeState],
    /// Which submaps are joined.
    pub(crate) submaps: &'a Submaps,
}

impl Refiner<'_> {
    /// Every frame solved again against the keyframes; keyframes take their own pose, and lost
    /// frames one between those around them.
    pub(crate) fn solve(&self, history: &dyn FrameHistory) -> Vec<(u64, PoseBits)> {
        let mut timeline = PoseTimeline::default();
        let mut solved: Vec<(u64, Pose)> = Vec::new();
        let mut chunk: Vec<FrameBlocks> = Vec::new();
        history.visit(&mut |frame| {
            timeline.add(frame);
            chunk.extend(FrameBlocks::of(frame));
            if chunk.len() >= CHUNK {
                solved.extend(self.solve_chunk(&chunk));
                chunk.clear();
            }
        });
        solved.extend(self.solve_chunk(&chunk));
        let own = &self.keyframes[self.n_map_keyframes..];
        let mut known: BTreeMap<u64, Pose> = solved.iter().copied().collect();
        let own_poses = self.poses.iter().skip(self.n_map_keyframes);
        known.extend(own.iter().zip(own_poses).map(|(k, pose)| (k.frame_index, *pose)));
        let mut frames: Vec<(u64, PoseBits)> =
            solved.iter().map(|(index, pose)| (*index, PoseBits::from(pose))).collect();
        frames.extend(timeline.interpolated(&known, |id| self.component(id)));
        frames.sort_by_key(|f| f.0);
        frames
    }

    fn component(&self, keyframe: u32) -> Option<u32> {
        self.keyframes.get(keyframe as usize).map(|k| self.submaps.component(k.submap))
    }

    fn solve_chunk(&self, chunk: &[FrameBlocks]) -> Vec<(u64, Pose)> {
        let own = &self.keyframes[self.n_map_keyframes..];
        let in_common = |a: u32, b: u32| self.component(a) == self.component(b);
        let solve = |frame: &FrameBlocks| {
            let pose = match own.binary_search_by_key(&frame.index, |k| k.frame_index) {
                Ok(place) => *self.poses.get(self.n_map_keyframes + place)?,
                Err(_) => frame.solve(self.poses, in_common)?,
            };
            Some((frame.index, pose))
        };
        chunk.par_iter().filter_map(solve).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};
    use tessera_graph::BlockSums;

    /// Matches on a wall with this normal, on the floor, and hardly any along the corridor.
    fn corridor(normal: Vector3<f64>) -> PairBlock {
        let (wall, floor) = (normal * normal.transpose(), Vector3::y() * Vector3::y().transpose());
        let omega = 1e6 * (wall + floor) + 1e-3 * Matrix3::identity();
        let mut sums = BlockSums::default();
        for point in [[-1.0, 1.0, 2.0], [1.0, 1.0, 2.0], [-1.0, -1.0, 3.0], [1.0, -1.0, 3.0], [0.5, 0.0, 2.5]]
        {
            sums.add(&Vector3::from(point), &Vector3::zeros(), &omega);
            sums.n += 1;
        }
        PairBlock::new(&Pose::identity(), &sums)
    }

    #[test]
    fn a_frame_between_walls_that_meet_far_away_stays_where_its_keyframe_has_it() {
        let apart_by = |x_m: f64| {
            let tilted = Vector3::new(1.0, 0.0, 0.02).normalize();
            let frame = FrameBlocks {
                index: 1,
                keyframe: 0,
                keyframe_from_camera: PoseBits::IDENTITY,
                blocks: vec![(0, corridor(Vector3::x())), (1, corridor(tilted))],
            };
            let poses = [Pose::identity(), Pose::translation(x_m, 0.0, 0.0)];
            frame.solve(&poses, |_, _| true).unwrap().translation.vector
        };
        assert!((apart_by(0.0002).z - 0.01).abs() < 0.002, "{}", apart_by(0.0002));
        assert_eq!(apart_by(0.03), Vector3::zeros(), "both walls fit a metre and a half away");
    }
}
