//! Cache of the sampled vertices of each keyframe, from one optimisation to the next.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A keyframe's id, the index of its frame and how many vertices it was drawn from.
type SampleKey = (u32, u64, usize);

/// Drawn vertices by keyframe. They are a function of the keyframe alone, so that it makes no
/// difference which of them are known; some kilobytes for each, where its samples would take 64.
#[derive(Debug, Default)]
pub(crate) struct Drawn(Mutex<BTreeMap<SampleKey, Arc<[u32]>>>);

impl Drawn {
    /// The drawn vertices of a keyframe, by `draw` where they are not known.
    pub(crate) fn of(&self, key: SampleKey, draw: impl FnOnce() -> Arc<[u32]>) -> Arc<[u32]> {
        let known = self.known().get(&key).cloned();
        known.unwrap_or_else(|| {
            let drawn = draw();
            self.known().insert(key, Arc::clone(&drawn));
            drawn
        })
    }

    /// Forgets all keyframes but those with these ids, which rise.
    pub(crate) fn keep_only(&self, ids: &[u32]) {
        self.known().retain(|(id, ..), _| ids.binary_search(id).is_ok());
    }

    fn known(&self) -> MutexGuard<'_, BTreeMap<SampleKey, Arc<[u32]>>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_is_not_drawn_again_until_it_is_forgotten() {
        let drawn = Drawn::default();
        let of = |id: u32, n_vertices: usize, value: u32| drawn.of((id, 7, n_vertices), || [value].into())[0];
        assert_eq!([of(3, 9, 1), of(3, 9, 2)], [1, 1]);
        assert_eq!([of(5, 9, 3), of(3, 8, 4)], [3, 4]);
        drawn.keep_only(&[4, 5]);
        assert_eq!([of(5, 9, 5), of(3, 9, 6)], [3, 6]);
    }
}
