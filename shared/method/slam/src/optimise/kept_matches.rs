//! Pairs of the last optimisation with the relative poses at which their matches were searched: a fold over the
//! optimiser's own records, so that a successor goes on where its predecessor was.

use crate::map::records::{MatchPose, MatchRecord, OptimiseRecord, PairChanges};
use crate::pairs::feature_cache::PairIds;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Where the matches of each pair of the working map were searched, by the ids of the newer and the older keyframe.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct KeptMatches(BTreeMap<PairIds, MatchPose>);

impl KeptMatches {
    /// Takes the next answer in; pairs of keyframes that it no longer solves for are forgotten.
    pub(crate) fn take(&mut self, record: &OptimiseRecord) {
        if let Some(PairChanges { searched, dropped }) = record.pair_changes() {
            self.0.retain(|pair, _| dropped.binary_search(pair).is_err());
            self.0.extend(searched.iter().map(|m| ((m.newer, m.older), m.at)));
        }
        let keyframes = &record.correction().keyframes;
        if !keyframes.is_empty() {
            let is_named = |id: u32| keyframes.binary_search_by_key(&id, |k| k.id).is_ok();
            self.0.retain(|(newer, older), _| is_named(*newer) && is_named(*older));
        }
    }

    pub(crate) fn of(&self, pair: PairIds) -> Option<MatchPose> {
        self.0.get(&pair).copied()
    }

    /// Pairs of keyframes with these ids, which rise, by their places.
    pub(crate) fn places(&self, ids: &[u32]) -> Vec<(usize, usize)> {
        let place = |id: u32| ids.binary_search(&id).ok();
        self.0.keys().filter_map(|(newer, older)| Some((place(*newer)?, place(*older)?))).collect()
    }

    /// How the pairs of an optimisation differ from these.
    pub(crate) fn changes(&self, found: &BTreeMap<PairIds, MatchPose>) -> PairChanges {
        let news = found.iter().filter(|(pair, at)| self.0.get(pair) != Some(at));
        let searched = news.map(|(&(newer, older), &at)| MatchRecord { newer, older, at }).collect();
        PairChanges {
            searched,
            dropped: self.0.keys().filter(|pair| !found.contains_key(pair)).copied().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::records::{Correction, KeyframePose};
    use tessera_geometry::{Pose, PoseBits};

    fn answer(keyframes: &[u32], changes: PairChanges) -> OptimiseRecord {
        let pose = |id: &u32| KeyframePose { id: *id, world_from_camera: PoseBits::IDENTITY };
        let correction =
            Correction { keyframes: keyframes.iter().map(pose).collect(), ..Correction::default() };
        OptimiseRecord::Incremental(Box::new(correction), changes)
    }

    #[test]
    fn the_changes_of_each_answer_lead_to_the_pairs_of_the_last() {
        let at = |x_m: f64| MatchPose::of(&Pose::translation(x_m, 0.0, 0.0));
        let mut kept = KeptMatches::default();
        for pairs in [
            BTreeMap::from([((1, 0), at(0.1)), ((2, 1), at(0.2)), ((3, 1), at(0.3))]),
            BTreeMap::from([((1, 0), at(0.1)), ((2, 1), at(0.4)), ((3, 2), at(0.5))]),
        ] {
            let changes = kept.changes(&pairs);
            kept.take(&answer(&[0, 1, 2, 3], changes));
            assert_eq!(kept.0, pairs);
        }
        assert_eq!(kept.places(&[1, 2, 3]), [(1, 0), (2, 1)]);
        let changes = kept.changes(&BTreeMap::from([((1, 0), at(0.1)), ((2, 1), at(0.4))]));
        assert_eq!((changes.searched.len(), &changes.dropped[..]), (0, &[(3, 2)][..]));
        kept.take(&answer(&[0, 2, 3], PairChanges::default()));
        assert_eq!(kept.0.keys().collect::<Vec<_>>(), [&(3, 2)], "a culled keyframe");
    }
}
