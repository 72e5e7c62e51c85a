//! Culled keyframes in the graph of all keyframes (method 12.2): their surfaces are not matched any
//! more, but what they measured as frames is kept with them and goes on to count.

use crate::map::context::Context;
use crate::map::culling::MOST_AT_A_TIME;
use crate::map::records::FrameRecord;
use crate::map::state::KeyframeState;
use crate::map::submaps::Submaps;
use crate::optimise::refine::FrameHistory;
use crate::settings::KeyframeSettings;
use crate::tracking::degeneracy::is_determined;
use std::collections::BTreeMap;
use std::ops::Range;
use tessera_geometry::Pose;
use tessera_graph::{Pair, PairBlock};

/// Weight of the blocks in a map at its budget: what is left of it is too sparse to bear the drift that
/// the frames had, and the blocks need only hold the culled keyframes.
const WEIGHT_AT_BUDGET: f64 = 0.1;

/// The journaled blocks of the frames that became keyframes, as far as a culled keyframe is at
/// either end.
#[derive(Clone, Debug, Default)]
pub(crate) struct CulledKeyframes {
    /// Ids of the culled keyframes that their blocks determine, rising.
    ids: Vec<u32>,
    blocks: Vec<KeyframeBlock>,
}

#[derive(Clone, Debug)]
struct KeyframeBlock {
    query: u32,
    target: u32,
    block: PairBlock,
}

/// The frames of one run of those that a map is of.
#[derive(Clone)]
pub(crate) struct RunFrames<'a> {
    /// Its keyframes, by their numbers in the map; its frames name them from 0 on.
    pub(crate) keyframes: Range<usize>,
    /// Which of them it made itself: its number among the runs of the map.
    pub(crate) session: u32,
    pub(crate) history: &'a dyn FrameHistory,
}

impl CulledKeyframes {
    /// Reads the blocks of the runs' keyframes from their frames. A culled keyframe that they leave
    /// undetermined, or that hangs on such ones alone, is not among them. `runs`: in the order of their keyframes.
    pub(crate) fn of(
        context: &Context,
        keyframes: &[KeyframeState],
        submaps: &Submaps,
        runs: &[RunFrames<'_>],
    ) -> Self {
        let mut culled = Self::default();
        for run in runs {
            let of_run = keyframes.get(run.keyframes.clone()).unwrap_or_default();
            if of_run.iter().all(KeyframeState::is_active) {
                continue;
            }
            let own: BTreeMap<u64, &KeyframeState> =
                of_run.iter().filter(|k| k.session == run.session).map(|k| (k.frame_index, k)).collect();
            run.history.visit(&mut |frame| {
                if let Some(query) = own.get(&frame.index) {
                    culled.add(context, (of_run, submaps), query, frame);
                }
            });
        }
        culled
    }

    fn add(
        &mut self,
        context: &Context,
        (of_run, submaps): (&[KeyframeState], &Submaps),
        query: &KeyframeState,
        frame: &FrameRecord,
    ) {
        let component = submaps.component(query.submap);
        let usable = |target: &KeyframeState| {
            target.id < query.id
                && submaps.component(target.submap) == component
                && (target.is_active() || self.ids.binary_search(&target.id).is_ok())
        };
        let targets = frame.evidence.blocks.iter().filter_map(|b| {
            let target = of_run.get(b.keyframe as usize).filter(|target| usable(target))?;
            Some((target, b.pair_block()?, Pose::from(&b.keyframe_from_camera)))
        });
        let found: Vec<(&KeyframeState, PairBlock, Pose)> = targets.collect();
        if !query.is_active() {
            let information = found.iter().map(|(_, block, at)| block.linearise(at).0).sum();
            if !is_determined(context, &information) {
                return;
            }
            self.ids.push(query.id);
        }
        let of_culled = found.into_iter().filter(|(target, ..)| !query.is_active() || !target.is_active());
        self.blocks.extend(of_culled.map(|(target, block, _)| KeyframeBlock {
            query: query.id,
            target: target.id,
            block,
        }));
    }

    /// Ids of the culled keyframes, rising.
    pub(crate) fn ids(&self) -> &[u32] {
        &self.ids
    }

    /// The blocks, which it has no more, as pairs of vertices: first the active keyframes, by these ids, which rise, then
    /// the culled ones.
    pub(crate) fn take_pairs(&mut self, active: &[KeyframeState], weight: f64) -> Vec<Pair> {
        let blocks = std::mem::take(&mut self.blocks);
        let vertex = |id: u32| {
            let culled = || Some(active.len() + self.ids.binary_search(&id).ok()?);
            active.binary_search_by_key(&id, |k| k.id).ok().or_else(culled)
        };
        let pair = |b: KeyframeBlock| {
            let pair = Pair::new(vertex(b.query)?, vertex(b.target)?, b.block);
            Some(Pair { weight, ..pair })
        };
        blocks.into_iter().filter_map(pair).collect()
    }
}

/// Weight of the blocks of culled keyframes in a map of so many: full where what others see as well was
/// culled, little where the budget culled what nothing else sees.
pub(crate) fn weight(settings: &KeyframeSettings, n_active: usize) -> f64 {
    let is_at_budget = settings.budget > 0 && n_active + MOST_AT_A_TIME >= settings.budget as usize;
    if is_at_budget { WEIGHT_AT_BUDGET } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_count_less_in_a_map_at_its_budget() {
        let budget = |budget| KeyframeSettings { budget, ..KeyframeSettings::default() };
        assert_eq!(weight(&budget(0), 5000), 1.0, "no budget");
        assert_eq!(weight(&budget(300), 120), 1.0, "not reached");
        assert_eq!(weight(&budget(300), 300), WEIGHT_AT_BUDGET);
        // As many as are culled at a time may be missing.
        assert_eq!(weight(&budget(300), 298), WEIGHT_AT_BUDGET);
    }
}
