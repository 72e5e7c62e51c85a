//! Pairs of keyframes that would close a loop, and what became of them.

use crate::{LoopPair, ReportedVerdict};
use tessera_outputs::Replay;
use tessera_slam::{LoopRecord, LoopVerdict};

/// A loop that the optimiser did not choose: it takes the nearest keyframes of each.
const NOT_CHOSEN: &str = "held by the aligner, which saw it; the optimiser has nearer pairs";
/// A loop after the last optimisation of a run that has not ended.
const NOT_YET: &str = "held by the aligner, which saw it; no optimisation since";

/// Every pair that the optimiser judged, and every loop of the aligner that it has no word on, behind them.
pub(super) fn of(replay: &Replay) -> Vec<LoopPair> {
    let judged = replay.loops.values().map(judged);
    let edges = replay.keyframes.iter().skip(replay.n_map_keyframes);
    let edges = edges.flat_map(|keyframe| keyframe.edges.iter().map(move |edge| (keyframe.id, edge)));
    let fresh = edges
        .filter(|(newer, edge)| edge.is_loop && !replay.loops.contains_key(&(*newer, edge.to)))
        .map(|(newer, edge)| LoopPair {
            newer,
            older: edge.to,
            verdict: ReportedVerdict::Untested,
            words: if replay.is_finally_optimised { NOT_CHOSEN } else { NOT_YET }.into(),
            numbers: [f64::NAN; 5],
        });
    // Each in the order of keyframes.
    judged.chain(fresh).collect()
}

fn judged(pair: &LoopRecord) -> LoopPair {
    let (verdict, words) = match pair.verdict {
        LoopVerdict::Accepted => (ReportedVerdict::Accepted, "closed"),
        LoopVerdict::LittleOverlap => (ReportedVerdict::Refused, "not verified: little overlap"),
        LoopVerdict::FreeSpaceViolated => {
            (ReportedVerdict::Refused, "not verified: floats in space seen to be empty")
        }
        LoopVerdict::Inconsistent => (ReportedVerdict::Refused, "not verified: both directions disagree"),
        LoopVerdict::Contradicted => (ReportedVerdict::Refused, "refused: a place that looks alike"),
        LoopVerdict::Outvoted => (ReportedVerdict::Outvoted, "rejected: contradicts the rest of the graph"),
    };
    let numbers = [pair.overlap, pair.in_front, pair.inconsistency_sigmas, pair.residual_sigmas, pair.weight];
    LoopPair { newer: pair.newer, older: pair.older, verdict, words: words.into(), numbers }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_outputs::test_run;

    #[test]
    fn each_pair_is_there_once() {
        let pairs = of(&test_run::replay());
        assert_eq!(pairs.iter().map(|pair| (pair.newer, pair.older)).collect::<Vec<_>>(), [(2, 0), (2, 1)]);
        assert_eq!((pairs[0].verdict, pairs[1].numbers[4]), (ReportedVerdict::Accepted, 0.1));
    }
}
