//! Surfaces of culled keyframes that the store need not keep (method 12.2).

use crate::map::culling::LOOKED_BACK_NANOS;
use crate::map::state::KeyframeState;

/// Culled keyframes whose surfaces are given up, so that those of the others take so many bytes at most in the
/// store: the oldest ones. What is given up stays so, however the map grows. None of the last seconds is: the next
/// frames look back at them (method 6). A function of the keyframes, however often it is asked.
#[derive(Debug, Default)]
pub struct GivenUp {
    /// Keyframes that lie before those whose surfaces are kept.
    n_before: u32,
    /// Those of them that are active yet, rising.
    active: Vec<u32>,
}

impl GivenUp {
    /// Those that are given up now and were not when it was last asked, of the same keyframes or of more.
    /// `kept_bytes`: bytes that the surfaces of culled keyframes may take.
    pub fn more<'a>(&mut self, keyframes: &'a [KeyframeState], kept_bytes: u64) -> Vec<&'a KeyframeState> {
        let n_before = (keyframes.len() - n_kept(keyframes, kept_bytes)) as u32;
        let asked = std::mem::take(&mut self.active).into_iter().chain(self.n_before..n_before);
        self.n_before = self.n_before.max(n_before);
        let mut given_up = Vec::new();
        for keyframe in asked.filter_map(|id| keyframes.get(id as usize)) {
            if keyframe.is_active() {
                self.active.push(keyframe.id);
            } else {
                given_up.push(keyframe);
            }
        }
        given_up
    }
}

/// How many of the newest keyframes keep their surfaces whether they are culled or not.
fn n_kept(keyframes: &[KeyframeState], kept_bytes: u64) -> usize {
    let newest = keyframes.last();
    let is_recent = |k: &KeyframeState| {
        newest.is_some_and(|newest| {
            k.session == newest.session
                && newest.stamp_nanos.saturating_sub(k.stamp_nanos) <= LOOKED_BACK_NANOS
        })
    };
    let mut kept = 0u64;
    let mut fits = |keyframe: &KeyframeState| {
        kept = kept.saturating_add(if keyframe.is_active() { 0 } else { keyframe.slot.len });
        kept <= kept_bytes || is_recent(keyframe)
    };
    keyframes.iter().rev().take_while(|keyframe| fits(keyframe)).count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::keyframe;

    #[test]
    fn the_oldest_of_the_culled_are_given_up_and_none_comes_back() {
        let mut keyframes: Vec<KeyframeState> = (0..8).map(|id| keyframe(id, 0, 0.0)).collect();
        for keyframe in &mut keyframes {
            (keyframe.slot.len, keyframe.stamp_nanos) = (10, i64::from(keyframe.id) * 6_000_000_000);
        }
        let more = |given_up: &mut GivenUp, keyframes: &[KeyframeState], bytes| -> Vec<u32> {
            given_up.more(keyframes, bytes).iter().map(|keyframe| keyframe.id).collect()
        };
        let all = |keyframes: &[KeyframeState], bytes| more(&mut GivenUp::default(), keyframes, bytes);
        let mut given_up = GivenUp::default();
        let mut so_far = Vec::new();
        for (culled, expected) in
            [(2, vec![]), (5, vec![]), (4, vec![2]), (1, vec![1, 2]), (6, vec![1, 2, 4])]
        {
            keyframes[culled].anchored_to = Some(0);
            so_far.extend(more(&mut given_up, &keyframes, 20));
            so_far.sort_unstable();
            assert_eq!((&so_far, all(&keyframes, 20)), (&expected, expected.clone()));
        }
        assert_eq!(more(&mut given_up, &keyframes, 20), [0; 0], "each once");
        assert_eq!(all(&keyframes, 0), [1, 2, 4, 5, 6]);
        assert_eq!(all(&keyframes, 50), []);
        // Tracking still looks back at the last one that was culled.
        keyframes[7].stamp_nanos = keyframes[6].stamp_nanos + 5_000_000_000;
        assert_eq!(all(&keyframes, 0), [1, 2, 4, 5]);
    }
}
