//! Index of the active keyframes: a run culls most of those that it makes, and a frame has no use for them.

use crate::map::keyframe::KeyframeState;

/// Ids of the active ones among the first keyframes. A short cut: what it does not cover is looked at, so
/// that a state without it, or one whose keyframes were added by other means, has the same active keyframes.
#[derive(Clone, Debug, Default)]
pub(crate) struct ActiveIds {
    /// Rising.
    ids: Vec<u32>,
    /// Keyframes that it covers.
    n_covered: usize,
}

impl PartialEq for ActiveIds {
    /// Always equal: it follows from the keyframes.
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl ActiveIds {
    /// The active keyframes among all, by id.
    pub(crate) fn of<'a>(
        &'a self,
        keyframes: &'a [KeyframeState],
    ) -> impl Iterator<Item = &'a KeyframeState> {
        let (ids, rest) = match keyframes.get(self.n_covered..) {
            Some(rest) => (&self.ids[..], rest),
            None => (&[][..], keyframes),
        };
        let covered = ids.iter().filter_map(|id| keyframes.get(*id as usize));
        covered.chain(rest).filter(|keyframe| keyframe.is_active())
    }

    /// Covers all keyframes.
    pub(crate) fn extend(&mut self, keyframes: &[KeyframeState]) {
        if self.n_covered > keyframes.len() {
            *self = Self::default();
        }
        let rest = keyframes[self.n_covered..].iter().filter(|keyframe| keyframe.is_active());
        self.ids.extend(rest.map(|keyframe| keyframe.id));
        self.n_covered = keyframes.len();
    }

    /// A keyframe is active no more.
    pub(crate) fn remove(&mut self, id: u32) {
        if let Ok(place) = self.ids.binary_search(&id) {
            self.ids.remove(place);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::keyframe;

    #[test]
    fn an_index_finds_what_a_look_at_all_finds() {
        let mut keyframes: Vec<KeyframeState> = (0..9).map(|id| keyframe(id, 0, 0.0)).collect();
        keyframes[4].anchored_to = Some(3);
        let mut index = ActiveIds::default();
        let found = |index: &ActiveIds, keyframes: &[KeyframeState]| -> Vec<u32> {
            index.of(keyframes).map(|k| k.id).collect()
        };
        assert_eq!(found(&index, &keyframes), [0, 1, 2, 3, 5, 6, 7, 8], "without an index all are looked at");
        index.extend(&keyframes[..7]);
        assert_eq!(index.ids, [0, 1, 2, 3, 5, 6]);
        keyframes[2].anchored_to = Some(1);
        index.remove(2);
        index.remove(4);
        assert_eq!(index.ids, [0, 1, 3, 5, 6]);
        assert_eq!(found(&index, &keyframes), [0, 1, 3, 5, 6, 7, 8]);
        index.extend(&keyframes);
        assert_eq!((&index.ids[..], index.n_covered), (&[0, 1, 3, 5, 6, 7, 8][..], 9));
        assert_eq!(found(&index, &keyframes[..3]), [0, 1], "fewer keyframes than it covers");
        index.extend(&keyframes[..3]);
        assert_eq!(index.ids, [0, 1]);
    }
}
