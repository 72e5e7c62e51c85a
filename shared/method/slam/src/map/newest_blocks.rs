//! Pair blocks of the newest keyframes with older ones, kept for the extended window (method 7).

use crate::map::records::{BlockRecord, KeyframeRecord};
use serde::{Deserialize, Serialize};

/// Keyframes in a row that share something with a view: those of the extended window, which are free, and behind them
/// those that are far away.
pub(crate) const N_FREE: u32 = 10;

/// The pair blocks of the newest keyframes, by the newer keyframe, each with an older one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct NewestBlocks(Vec<(u32, BlockRecord)>);

impl NewestBlocks {
    /// Takes in a new keyframe with the blocks of the frame that it was; the oldest ones leave.
    pub(crate) fn add(&mut self, keyframe: &KeyframeRecord, blocks: &[BlockRecord]) {
        let first = (keyframe.id + 1).saturating_sub(N_FREE);
        self.0.retain(|(newer, _)| *newer >= first);
        self.0.extend(blocks.iter().map(|block| (keyframe.id, block.clone())));
    }

    /// All of them, by the newer keyframe.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (u32, &BlockRecord)> {
        self.0.iter().map(|(newer, block)| (*newer, block))
    }
}
