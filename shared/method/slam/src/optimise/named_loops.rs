//! Loop pairs that the corrections of a run have named: a correction names those of which it tells something
//! else, so that the journals grow with the way and not with the map.

use crate::map::records::{Correction, LoopRecord, LoopVerdict};
use crate::map::sorted_keys::values_of;
use crate::pairs::feature_cache::PairIds;
use crate::pairs::verification::Tested;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::iter::zip;

/// Loop pairs of the working map, by the ids of the newer and the older keyframe, as last named: a
/// fold over the corrections.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct NamedLoops(BTreeMap<PairIds, (Tested, bool)>);

impl NamedLoops {
    /// Takes the next correction in; pairs of keyframes that it no longer solves for are forgotten.
    pub(crate) fn take(&mut self, correction: &Correction) {
        let named = |l: &LoopRecord| {
            let tested = Tested {
                overlap: l.overlap,
                in_front: l.in_front,
                inconsistency_sigmas: l.inconsistency_sigmas,
                verdict: l.verdict,
            };
            ((l.newer, l.older), (tested, has_weight(l)))
        };
        self.0.extend(correction.loops.iter().map(named));
        if !correction.keyframes.is_empty() {
            let is_named = |id: u32| correction.keyframes.binary_search_by_key(&id, |k| k.id).is_ok();
            self.0.retain(|(newer, older), _| is_named(*newer) && is_named(*older));
        }
    }

    /// The records that tell more than was named; their ids rise.
    pub(crate) fn not_named(&self, loops: Vec<LoopRecord>) -> Vec<LoopRecord> {
        let before = values_of(loops.iter().map(|pair| (pair.newer, pair.older)), self.0.iter());
        let is_named = |pair: &LoopRecord, (named, had_weight): &(Tested, bool)| {
            (named.verdict, *had_weight) == (pair.verdict, has_weight(pair))
        };
        let news =
            zip(&loops, before).filter(|(pair, named)| named.is_none_or(|named| !is_named(pair, named)));
        news.map(|(pair, _)| *pair).collect()
    }

    /// These pairs as last named, whose ids rise. One that lost its weight had passed its tests.
    pub(crate) fn of(&self, pairs: &[PairIds]) -> impl Iterator<Item = Option<Tested>> {
        let verdict = |verdict: LoopVerdict| match verdict {
            LoopVerdict::Outvoted => LoopVerdict::Accepted,
            named => named,
        };
        let named =
            move |(tested, _): &(Tested, bool)| Tested { verdict: verdict(tested.verdict), ..*tested };
        values_of(pairs.iter().copied(), self.0.iter()).map(move |known| known.map(named))
    }

    /// Whether a pair is of two places that look alike.
    pub(crate) fn is_contradicted(&self, pair: &PairIds) -> bool {
        self.0.get(pair).is_some_and(|(tested, _)| tested.verdict == LoopVerdict::Contradicted)
    }
}

/// Whether the optimiser counted a pair rather than set it aside: its cost has a factor of 0 to 1.
fn has_weight(pair: &LoopRecord) -> bool {
    pair.weight >= 1.0 - pair.weight
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::records::KeyframePose;
    use tessera_geometry::PoseBits;

    fn pair(newer: u32, older: u32, verdict: LoopVerdict, weight: f64) -> LoopRecord {
        let (overlap, in_front, inconsistency_sigmas, residual_sigmas) = (0.5, 0.1, 0.2, weight);
        LoopRecord { newer, older, overlap, in_front, inconsistency_sigmas, residual_sigmas, weight, verdict }
    }

    fn correction(keyframes: &[u32], loops: &[LoopRecord]) -> Correction {
        let pose = |id: &u32| KeyframePose { id: *id, world_from_camera: PoseBits::IDENTITY };
        Correction {
            keyframes: keyframes.iter().map(pose).collect(),
            loops: loops.to_vec(),
            ..Correction::default()
        }
    }

    #[test]
    fn a_pair_is_named_again_where_its_verdict_or_its_weight_changes_and_forgotten_with_its_keyframe() {
        use LoopVerdict::{Accepted, Inconsistent, Outvoted};
        let mut named = NamedLoops::default();
        let first = [pair(8, 1, Accepted, 1.0), pair(9, 1, Outvoted, 0.0), pair(9, 2, Inconsistent, 0.0)];
        let not_named = |named: &NamedLoops, loops: &[LoopRecord]| -> Vec<PairIds> {
            named.not_named(loops.to_vec()).iter().map(|pair| (pair.newer, pair.older)).collect()
        };
        assert_eq!(not_named(&named, &first[..1]), [(8, 1)]);
        named.take(&correction(&[1, 2, 8, 9], &first));
        assert_eq!(not_named(&named, &first), []);
        assert_eq!(
            not_named(&named, &[pair(8, 1, Accepted, 0.9)]),
            [],
            "a weight moves in each optimisation"
        );
        let others = [pair(8, 1, Accepted, 0.4), pair(9, 2, Accepted, 1.0)];
        assert_eq!(not_named(&named, &others), [(8, 1), (9, 2)]);
        let verdicts: Vec<_> =
            named.of(&[(8, 0), (8, 1), (9, 1), (9, 2)]).map(|t| Some(t?.verdict)).collect();
        assert_eq!(verdicts, [None, Some(Accepted), Some(Accepted), Some(Inconsistent)]);
        named.take(&correction(&[], &[]));
        assert_eq!(not_named(&named, &first), [], "a request that was declined");
        named.take(&correction(&[1, 8, 9], &[pair(9, 1, Accepted, 1.0)]));
        assert_eq!(not_named(&named, &first), [(9, 1), (9, 2)]);
    }
}
