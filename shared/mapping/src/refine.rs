//! A frame solved again against optimised keyframes, from its journaled blocks (SPEC 5.3, 8).

use crate::records::FrameRecord;
use tessera_geometry::{Pose, PoseBits};
use tessera_registration::{BlockSums, Graph, Pair, PairBlock};

/// What must be kept of a frame to solve it again.
#[derive(Clone, Debug)]
pub(crate) struct FrameBlocks {
    pub(crate) index: u64,
    keyframe: u32,
    keyframe_from_camera: PoseBits,
    blocks: Vec<(u32, PoseBits, Box<BlockSums>)>,
}

impl FrameBlocks {
    pub(crate) fn of(frame: &FrameRecord) -> Option<Self> {
        let blocks: Vec<_> = frame
            .blocks
            .iter()
            .filter_map(|b| {
                let sums = BlockSums::from_numbers(&b.sums, b.n_matches)?;
                Some((b.keyframe, b.keyframe_from_camera, Box::new(sums)))
            })
            .collect();
        (!blocks.is_empty()).then_some(Self {
            index: frame.index,
            keyframe: frame.keyframe,
            keyframe_from_camera: frame.keyframe_from_camera,
            blocks,
        })
    }

    /// The pose that fits all blocks best, keyframes fixed; `None` when they do not determine it.
    pub(crate) fn solve(&self, keyframe_poses: &[Pose]) -> Option<Pose> {
        let start = keyframe_poses.get(self.keyframe as usize)? * Pose::from(&self.keyframe_from_camera);
        let mut graph = Graph::default();
        for (keyframe, origin, sums) in &self.blocks {
            let target = graph.poses.len();
            graph.poses.push(*keyframe_poses.get(*keyframe as usize)?);
            graph.is_fixed.push(true);
            let block = PairBlock::new(&Pose::from(origin), sums);
            graph.pairs.push(Pair { query: self.blocks.len(), target, block, weight: 1.0 });
        }
        graph.poses.push(start);
        graph.is_fixed.push(false);
        graph.optimise(10, &mut || ()).ok()?;
        graph.poses.pop()
    }
}
