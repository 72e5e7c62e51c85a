//! Scheduling of periodic work over frames, so that no frame takes long.
//!
//! A frame that makes a keyframe is aligned twice, and the one behind it looks for what contradicts the map
//! (`tracking/departure.rs`). Other work is left to the others where there are any.

use crate::tracking::input::TrackingInput;

/// The turn of this frame, counted in steps of `every` frames, three at least; `None` where it has none. One of the
/// first three frames of a step has it.
pub(crate) fn turn(input: &TrackingInput<'_>, every: u64, makes_keyframe: bool) -> Option<u64> {
    let index = input.frame.index;
    let mut made = input.map.keyframes().rev().take_while(|k| input.map.is_own(k)).map(|k| k.frame_index);
    let [last, before] = [made.next(), made.next()];
    let pace = KeyframePace {
        makes_keyframe,
        n_since: last.map(|last| index.saturating_sub(last).saturating_sub(1)),
        n_between: last.zip(before).map(|(last, before)| last.saturating_sub(before)),
    };
    pace.has_turn(index % every).then_some(index / every)
}

/// How keyframes come.
#[derive(Clone, Copy)]
struct KeyframePace {
    makes_keyframe: bool,
    /// Frames since the one that made the last keyframe: 1 behind it.
    n_since: Option<u64>,
    /// Frames between the ones that made the last keyframe and the one before it.
    n_between: Option<u64>,
}

impl KeyframePace {
    /// Whether the frame at this place of its step has the turn: the first one that is free, and the third one
    /// where neither of those before it was.
    fn has_turn(&self, place: u64) -> bool {
        let within = |n: Option<u64>, frames: u64| n.is_some_and(|n| n <= frames);
        match place {
            0 => !self.makes_keyframe && !within(self.n_since, 1),
            1 => !self.makes_keyframe && self.n_since == Some(2),
            2 => self.n_since == Some(2) || (within(self.n_since, 1) && within(self.n_between, 2)),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_numerics::SplitMix64;

    #[test]
    fn one_frame_of_a_step_has_the_turn_and_a_free_one_if_there_is_one() {
        let mut random = SplitMix64::new(4);
        for (every, odds) in [(3u64, 1), (3, 2), (3, 3), (3, 9), (8, 1), (8, 2), (8, 4), (8, 30)] {
            let makes: Vec<bool> = (0..3000).map(|frame| frame == 0 || random.below(odds) == 0).collect();
            let mut made: Vec<u64> = Vec::new();
            // By frame from the fourth on: whether it is free, and whether it has the turn.
            let mut frames = Vec::new();
            for (frame, &makes_keyframe) in (0u64..).zip(&makes) {
                let [last, before] = [1, 2].map(|back| made.len().checked_sub(back).map(|at| made[at]));
                let pace = KeyframePace {
                    makes_keyframe,
                    n_since: last.map(|last| frame - last),
                    n_between: last.zip(before).map(|(last, before)| last - before),
                };
                let is_free = !makes_keyframe && last != frame.checked_sub(1);
                frames.push((is_free, pace.has_turn(frame % every)));
                if makes_keyframe {
                    made.push(frame);
                }
            }
            for step in frames.chunks_exact(every as usize).skip(2) {
                let had: Vec<bool> =
                    step.iter().filter(|(_, has)| *has).map(|(is_free, _)| *is_free).collect();
                let is_any_free = step[..3].iter().any(|(is_free, _)| *is_free);
                assert_eq!(had, [is_any_free], "every {every}, odds {odds}: {step:?}");
            }
        }
    }
}
