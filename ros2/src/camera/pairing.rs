//! Colour images to depth images by their times, as they come: the nearest by the running offset, one to one, and no
//! depth image waits for long.

use std::collections::VecDeque;
use tessera_frames::colour_offset::ColourOffset;

/// Longest time that a depth image waits for its colour.
const PATIENCE_NANOS: i64 = 150_000_000;
/// Colour images that are kept.
const MOST_COLOURS: usize = 8;
/// Depth images that wait; more, and the oldest goes without colour.
const MOST_DEPTHS: usize = 4;

/// A message with its time in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Stamped {
    pub(crate) stamp_nanos: i64,
    /// Number of the message on its topic.
    pub(crate) index: u64,
    pub(crate) message: Vec<u8>,
}

/// What waits for its partner.
#[derive(Debug, Default)]
pub(crate) struct LivePairing {
    /// Each with the time at which it came.
    depths: VecDeque<(Stamped, i64)>,
    colours: VecDeque<Stamped>,
    offset: ColourOffset,
}

impl LivePairing {
    /// A depth image came, at a time of any clock that is that of [`Self::next`].
    pub(crate) fn add_depth(&mut self, depth: Stamped, now_nanos: i64) {
        self.depths.push_back((depth, now_nanos));
    }

    pub(crate) fn add_colour(&mut self, colour: Stamped) {
        if self.colours.len() == MOST_COLOURS {
            self.colours.pop_front();
        }
        self.colours.push_back(colour);
    }

    /// The next depth image whose colour is known, or known to be missing. Without `has_colour`
    /// none waits.
    pub(crate) fn next(&mut self, has_colour: bool, now_nanos: i64) -> Option<(Stamped, Option<Stamped>)> {
        let (depth, came) = self.depths.front()?;
        let stamp = depth.stamp_nanos;
        // Colour comes in the order of its times: what comes after a later one is further away.
        let is_known = self.colours.back().is_some_and(|colour| colour.stamp_nanos >= stamp);
        // A clock that jumped back says nothing of how long it waited.
        let is_over = !(0..PATIENCE_NANOS).contains(&now_nanos.saturating_sub(*came));
        let is_late = is_over || self.depths.len() > MOST_DEPTHS;
        if has_colour && !is_known && !is_late {
            return None;
        }
        let distance = |colour: i64, stamp: i64| self.offset.distance_nanos(colour.saturating_sub(stamp));
        let near =
            self.colours.iter().enumerate().filter_map(|(at, colour)| {
                Some((distance(colour.stamp_nanos, stamp)?, at, colour.stamp_nanos))
            });
        let nearest = near.min();
        // A later depth image that waits already may be nearer.
        let is_taken = |(least, _, colour): &(i64, usize, i64)| {
            let next = self.depths.get(1).and_then(|(next, _)| distance(*colour, next.stamp_nanos));
            next.is_none_or(|of_next| of_next >= *least)
        };
        let taken = nearest.filter(is_taken).map(|(_, at, _)| at);
        let colour = taken.and_then(|at| self.colours.remove(at));
        if let Some(colour) = &colour {
            self.offset.add(colour.stamp_nanos.saturating_sub(stamp));
        }
        self.depths.pop_front().map(|(depth, _)| (depth, colour))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamped(millis: i64) -> Stamped {
        Stamped { stamp_nanos: millis * 1_000_000, index: 0, message: Vec::new() }
    }

    fn millis(pair: Option<(Stamped, Option<Stamped>)>) -> Option<(i64, Option<i64>)> {
        let of = |stamped: Stamped| stamped.stamp_nanos / 1_000_000;
        pair.map(|(depth, colour)| (of(depth), colour.map(of)))
    }

    #[test]
    fn a_depth_image_waits_until_its_colour_is_known() {
        let (mut pairing, now) = (LivePairing::default(), 5_000_000_000);
        pairing.add_depth(stamped(100), now);
        pairing.add_colour(stamped(70));
        assert_eq!(pairing.next(true, now), None);
        pairing.add_colour(stamped(103));
        assert_eq!(millis(pairing.next(true, now)), Some((100, Some(103))));
        pairing.add_depth(stamped(133), now);
        assert_eq!(pairing.next(true, now), None);
        assert_eq!(pairing.next(true, now + PATIENCE_NANOS - 1), None);
        assert_eq!(millis(pairing.next(true, now + PATIENCE_NANOS)), Some((133, None)));
        assert_eq!(pairing.next(true, now + PATIENCE_NANOS), None);
        pairing.add_depth(stamped(167), now);
        assert_eq!(millis(pairing.next(true, now - 1)), Some((167, None)), "the clock jumped back");
    }

    #[test]
    fn colours_far_away_or_nearer_to_the_next_are_not_taken() {
        let (mut pairing, now) = (LivePairing::default(), 5_000_000_000);
        pairing.add_depth(stamped(100), now);
        pairing.add_depth(stamped(110), now);
        pairing.add_colour(stamped(108));
        assert_eq!(millis(pairing.next(true, now)), Some((100, None)));
        pairing.add_colour(stamped(131));
        assert_eq!(millis(pairing.next(true, now)), Some((110, Some(108))));
        pairing.add_depth(stamped(200), now);
        pairing.add_colour(stamped(220));
        assert_eq!(millis(pairing.next(true, now)), Some((200, None)));
    }

    #[test]
    fn nothing_waits_without_colour_and_memory_is_bounded() {
        let (mut pairing, now) = (LivePairing::default(), 5_000_000_000);
        pairing.add_depth(stamped(1), now);
        assert_eq!(millis(pairing.next(false, now)), Some((1, None)));
        (0..100).for_each(|at| pairing.add_colour(stamped(at)));
        assert_eq!(pairing.colours.len(), MOST_COLOURS);
        (200..210).for_each(|at| pairing.add_depth(stamped(at), now));
        let n = std::iter::from_fn(|| pairing.next(true, now)).count();
        assert_eq!((n, pairing.depths.len()), (6, MOST_DEPTHS));
    }
}
