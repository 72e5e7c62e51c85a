//! What the corrections of a run have said of loop pairs: a correction names those of which it says something
//! else, so that the journals grow with the way and not with the map.

use crate::map::records::{Correction, LoopRecord, LoopVerdict};
use crate::pairs::verification::{KnownLoops, Tested};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Factor of a pair's cost below which the optimiser set it aside.
const LITTLE_WEIGHT: f64 = 0.5;

/// Loop pairs of the working map, by the ids of the newer and the older keyframe, with what was last said: a
/// fold over the corrections.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct SaidLoops(BTreeMap<(u32, u32), (Tested, bool)>);

impl SaidLoops {
    /// Takes the next correction in; pairs of keyframes that it no longer solves for are forgotten.
    pub(crate) fn take(&mut self, correction: &Correction) {
        let said = |l: &LoopRecord| {
            let tested = Tested {
                overlap: l.overlap,
                in_front: l.in_front,
                inconsistency_sigmas: l.inconsistency_sigmas,
                verdict: l.verdict,
            };
            ((l.newer, l.older), (tested, l.weight >= LITTLE_WEIGHT))
        };
        self.0.extend(correction.loops.iter().map(said));
        if !correction.keyframes.is_empty() {
            let is_named = |id: u32| correction.keyframes.binary_search_by_key(&id, |k| k.id).is_ok();
            self.0.retain(|(newer, older), _| is_named(*newer) && is_named(*older));
        }
    }

    /// Whether a record says no more than what was said.
    pub(crate) fn is_said(&self, pair: &LoopRecord) -> bool {
        self.0.get(&(pair.newer, pair.older)).is_some_and(|(said, has_weight)| {
            (said.verdict, *has_weight) == (pair.verdict, pair.weight >= LITTLE_WEIGHT)
        })
    }

    /// Pairs that passed their tests, which need no other, and those of places that look alike.
    pub(crate) fn settled(&self) -> KnownLoops {
        self.known(|verdict| match verdict {
            LoopVerdict::Accepted | LoopVerdict::Outvoted => Some(LoopVerdict::Accepted),
            LoopVerdict::Contradicted => Some(LoopVerdict::Contradicted),
            LoopVerdict::LittleOverlap | LoopVerdict::FreeSpaceViolated | LoopVerdict::Inconsistent => None,
        })
    }

    /// Pairs that did not pass their tests where they were.
    pub(crate) fn refused(&self) -> KnownLoops {
        use LoopVerdict::{FreeSpaceViolated, Inconsistent, LittleOverlap};
        let is_refused = |v: &LoopVerdict| matches!(v, LittleOverlap | FreeSpaceViolated | Inconsistent);
        self.known(|verdict| Some(verdict).filter(is_refused))
    }

    fn known(&self, verdict: impl Fn(LoopVerdict) -> Option<LoopVerdict>) -> KnownLoops {
        let known = |tested: &Tested| Some(Tested { verdict: verdict(tested.verdict)?, ..*tested });
        self.0.iter().filter_map(|(ids, (tested, _))| Some((*ids, known(tested)?))).collect()
    }
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
    fn a_pair_is_said_again_where_its_verdict_or_its_weight_changes_and_forgotten_with_its_keyframe() {
        use LoopVerdict::{Accepted, Inconsistent, Outvoted};
        let mut said = SaidLoops::default();
        let first = [pair(8, 1, Accepted, 1.0), pair(9, 1, Outvoted, 0.0), pair(9, 2, Inconsistent, 0.0)];
        assert!(!said.is_said(&first[0]));
        said.take(&correction(&[1, 2, 8, 9], &first));
        assert!(first.iter().all(|pair| said.is_said(pair)));
        assert!(said.is_said(&pair(8, 1, Accepted, 0.9)), "a weight moves in each optimisation");
        assert!(!said.is_said(&pair(8, 1, Accepted, 0.4)) && !said.is_said(&pair(9, 2, Accepted, 1.0)));
        assert_eq!(said.settled().keys().collect::<Vec<_>>(), [&(8, 1), &(9, 1)]);
        assert_eq!(said.settled()[&(9, 1)].verdict, Accepted);
        said.take(&correction(&[], &[]));
        assert!(first.iter().all(|pair| said.is_said(pair)), "a request that was declined");
        said.take(&correction(&[1, 8, 9], &[pair(9, 1, Accepted, 1.0)]));
        assert_eq!(first.map(|pair| said.is_said(&pair)), [true, false, false]);
    }
}
