//! What keyframes see of other runs, from one joint map to the next.
//!
//! What a keyframe sees is a function of it, of the one nearest to it and of the components before its own; whether
//! that joins them, of its own component too. Their hash is the key, so that it makes no difference what is kept and
//! what is looked for anew.

use crate::map::input_hash::Fnv;
use crate::map::state::{KeyframeState, TrackerState};
use std::collections::BTreeMap;
use std::fmt::Debug;

/// A keyframe and the hash of all that its look depends on.
type LookKey = (u32, u64);

/// Outcomes of looks by their keys.
#[derive(Debug)]
pub(crate) struct KnownLooks<T> {
    /// Those of the last map.
    known: BTreeMap<LookKey, T>,
    /// Those of this map.
    used: BTreeMap<LookKey, T>,
    /// Looks of this map that were known.
    n_known: usize,
}

impl<T> Default for KnownLooks<T> {
    fn default() -> Self {
        Self { known: BTreeMap::new(), used: BTreeMap::new(), n_known: 0 }
    }
}

impl<T: Copy> KnownLooks<T> {
    /// A new map begins: what the last one did not use is forgotten.
    pub(crate) fn begin(&mut self) {
        self.known = std::mem::take(&mut self.used);
        self.n_known = 0;
    }

    /// The outcome of a look, by `look` where it is not known.
    pub(crate) fn of(&mut self, key: LookKey, look: impl FnOnce() -> T) -> T {
        let known = self.known.get(&key).or_else(|| self.used.get(&key)).copied();
        self.n_known += usize::from(known.is_some());
        let outcome = known.unwrap_or_else(look);
        self.used.insert(key, outcome);
        outcome
    }

    /// Looks of the last map, and those of them that were known before.
    pub(crate) fn counts(&self) -> (usize, usize) {
        (self.used.len(), self.n_known)
    }
}

/// Hashes of the active keyframes of each component, as they are between two joins.
pub(crate) struct ComponentHashes(BTreeMap<u32, u64>);

impl ComponentHashes {
    pub(crate) fn of(state: &TrackerState) -> Self {
        let mut hashes: BTreeMap<u32, Fnv> = BTreeMap::new();
        for keyframe in state.keyframes.iter().filter(|k| k.is_active()) {
            eat(hashes.entry(state.submaps.component(keyframe.submap)).or_default(), keyframe);
        }
        Self(hashes.into_iter().map(|(component, hash)| (component, hash.value())).collect())
    }

    /// The key of what `own` sees of the components before its own, beside the keyframe nearest to it; `colour`: all
    /// that is known of it.
    pub(crate) fn seen(
        &self,
        colour: &impl Debug,
        (own, beside): (&KeyframeState, Option<&KeyframeState>),
        component: u32,
    ) -> LookKey {
        self.key(colour, (own, beside), self.0.range(..component))
    }

    /// The key of a join of its component with those before it.
    pub(crate) fn joined(&self, colour: &impl Debug, own: &KeyframeState, component: u32) -> LookKey {
        self.key(colour, (own, None), self.0.range(..=component))
    }

    fn key<'a>(
        &self,
        colour: &impl Debug,
        (own, beside): (&KeyframeState, Option<&KeyframeState>),
        components: impl Iterator<Item = (&'a u32, &'a u64)>,
    ) -> LookKey {
        let mut hash = Fnv::default();
        hash.eat_debug(colour);
        [Some(own), beside].into_iter().flatten().for_each(|keyframe| eat(&mut hash, keyframe));
        for (component, keyframes) in components {
            hash.eat(u64::from(*component));
            hash.eat(*keyframes);
        }
        (own.id, hash.value())
    }
}

fn eat(hash: &mut Fnv, keyframe: &KeyframeState) {
    hash.eat(identity(keyframe));
    let pose = &keyframe.world_from_camera;
    pose.translation_m.iter().chain(&pose.rotation_xyzw).for_each(|v| hash.eat(v.to_bits()));
}

/// What a keyframe is but for its pose: two with the same value and number are the same.
pub(crate) fn identity(keyframe: &KeyframeState) -> u64 {
    let mut hash = Fnv::default();
    for id in [keyframe.id, keyframe.session, keyframe.submap, keyframe.slot.crc] {
        hash.eat(u64::from(id));
    }
    for number in [keyframe.frame_index, keyframe.stamp_nanos as u64, keyframe.slot.offset, keyframe.slot.len]
    {
        hash.eat(number);
    }
    keyframe.velocity.iter().for_each(|v| hash.eat(v.to_bits()));
    hash.value()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::keyframe;

    #[test]
    fn a_look_is_known_until_something_before_it_changes() {
        let keyframes = (0..4).map(|id| keyframe(id, 0, 0.0)).collect();
        let mut state = TrackerState { keyframes, ..TrackerState::default() };
        state.submaps.extend_to(1);
        state.keyframes[2].submap = 1;
        state.keyframes[3].submap = 1;
        let keys = |state: &TrackerState| {
            let (own, hashes) = (&state.keyframes[2], ComponentHashes::of(state));
            [hashes.seen(&state.colour, (own, None), 1), hashes.joined(&state.colour, own, 1)]
        };
        let before = keys(&state);
        let mut grown = state.clone();
        grown.keyframes.push(keyframe(4, 0, 0.0));
        grown.submaps.extend_to(2);
        grown.keyframes[4].submap = 2;
        assert_eq!(keys(&grown), before, "a run behind it");
        let moved = |id: usize| {
            let mut moved = state.clone();
            moved.keyframes[id].world_from_camera.translation_m[0] += 0.01;
            let after = keys(&moved);
            [after[0] == before[0], after[1] == before[1]]
        };
        assert_eq!(moved(0), [false, false], "a keyframe that it may see");
        assert_eq!(moved(3), [true, false], "another one of its own component");
        assert_eq!(moved(2), [false, false], "its own pose");
    }

    #[test]
    fn what_one_map_did_not_use_the_next_one_looks_for_anew() {
        let mut looks = KnownLooks::default();
        let mut n_looked = 0;
        for (map, keys) in [[1, 2], [1, 3], [1, 2]].into_iter().enumerate() {
            looks.begin();
            for key in keys {
                looks.of((key, 7), || n_looked += 1);
            }
            assert_eq!(looks.counts(), (2, usize::from(map > 0)));
        }
        assert_eq!(n_looked, 4);
    }
}
