//! Pairs of the last optimisation with the relative poses at which their matches were searched: a fold over the
//! optimiser's own records, so that a successor goes on where its predecessor was.

use crate::map::records::{MatchPose, MatchRecord, OptimiseRecord, PairChanges};
use crate::map::sorted_keys::values_of;
use crate::pairs::feature_cache::PairIds;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::iter::zip;

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

    /// Where these pairs, whose ids rise, were searched.
    pub(crate) fn of(&self, pairs: &[PairIds]) -> impl Iterator<Item = Option<MatchPose>> {
        values_of(pairs.iter().copied(), self.0.iter()).map(Option::<&MatchPose>::copied)
    }

    /// Pairs of keyframes with these ids, which rise, by their places.
    pub(crate) fn places(&self, ids: &[u32]) -> Vec<(usize, usize)> {
        let mut place = vec![None; ids.last().map_or(0, |last| *last as usize + 1)];
        ids.iter().enumerate().for_each(|(k, id)| place[*id as usize] = Some(k));
        let place = |id: u32| place.get(id as usize).copied().flatten();
        self.0.keys().filter_map(|(newer, older)| Some((place(*newer)?, place(*older)?))).collect()
    }

    /// How the pairs of an optimisation, whose ids rise, differ from these.
    pub(crate) fn changes(&self, found: &[(PairIds, MatchPose)]) -> PairChanges {
        let before = values_of(found.iter().map(|(pair, _)| *pair), self.0.iter());
        let news = zip(found, before).filter(|((_, at), before)| *before != Some(at));
        let searched = news.map(|(&((newer, older), at), _)| MatchRecord { newer, older, at }).collect();
        let now = values_of(self.0.keys().copied(), found.iter().map(|(pair, at)| (pair, at)));
        let dropped = zip(self.0.keys(), now).filter(|(_, now)| now.is_none());
        PairChanges { searched, dropped: dropped.map(|(pair, _)| *pair).collect() }
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
            let changes = kept.changes(&Vec::from_iter(pairs.clone()));
            kept.take(&answer(&[0, 1, 2, 3], changes));
            assert_eq!(kept.0, pairs);
        }
        assert_eq!(kept.places(&[1, 2, 3]), [(1, 0), (2, 1)]);
        let changes = kept.changes(&[((1, 0), at(0.1)), ((2, 1), at(0.4))]);
        assert_eq!((changes.searched.len(), &changes.dropped[..]), (0, &[(3, 2)][..]));
        kept.take(&answer(&[0, 2, 3], PairChanges::default()));
        assert_eq!(kept.0.keys().collect::<Vec<_>>(), [&(3, 2)], "a culled keyframe");
    }
}
