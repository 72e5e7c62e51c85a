//! Measures of the building and times of its lift: its own, or drawn by a seed.

use super::{N_STOREYS, ROOM_M};
use crate::random;

/// What another building has otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Proportions {
    /// Half width of the corridor, metres.
    pub(super) corridor_half_m: f64,
    /// Parts of a stop in the lift, seconds: turning round, the door's movement, the ride from each storey.
    pub(super) turn_s: f64,
    pub(super) door_s: f64,
    pub(super) ride_s: [f64; N_STOREYS],
}

impl Proportions {
    /// Those of the building that all tests know.
    const OWN: Self = Self { corridor_half_m: 1.0, turn_s: 5.0, door_s: 2.0, ride_s: [5.0, 5.0, 8.0] };

    /// The building's own for 0, else those drawn by this seed.
    pub(crate) fn drawn(seed: u64) -> Self {
        if seed == 0 {
            return Self::OWN;
        }
        let key = random::word(seed, 0x9a09);
        let between = |at: u64, low: f64, high: f64| low + random::unit(key, at) * (high - low);
        Self {
            corridor_half_m: between(0, 0.75, 1.4),
            turn_s: between(1, 3.0, 7.0),
            door_s: between(2, 1.0, 4.0),
            ride_s: std::array::from_fn(|storey| between(3 + storey as u64, 3.0, 12.0)),
        }
    }

    /// Middle of the northern row, metres along y; that of the southern one is its negative.
    pub(super) fn row_m(&self) -> f64 {
        self.corridor_half_m + 0.5 * ROOM_M
    }

    /// Half length of the lobbies, and of the storey, along y.
    pub(super) fn lobby_half_m(&self) -> f64 {
        self.corridor_half_m + ROOM_M
    }

    /// Seconds of a stop in the lift.
    pub(super) fn stop_s(&self, storey: usize) -> f64 {
        self.turn_s + self.door_s + self.ride_s[storey] + self.door_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn proportions_are_drawn_by_their_seed_and_without_one_are_the_buildings_own() {
        let own = Proportions::drawn(0);
        assert_eq!((own.row_m(), own.lobby_half_m(), own.stop_s(2)), (3.5, 6.0, 17.0));
        let drawn: Vec<Proportions> = (1..200).map(Proportions::drawn).collect();
        assert_eq!(drawn[6], Proportions::drawn(7));
        let spread = |of: &dyn Fn(&Proportions) -> f64, low: f64, high: f64| {
            let (least, most) = drawn.iter().map(of).fold((high, low), |(l, m), x| (x.min(l), x.max(m)));
            let tenth = 0.1 * (high - low);
            assert!(low <= least && least < low + tenth && high - tenth < most && most <= high);
        };
        spread(&|p| p.corridor_half_m, 0.75, 1.4);
        spread(&|p| p.turn_s, 3.0, 7.0);
        spread(&|p| p.door_s, 1.0, 4.0);
        (0..N_STOREYS).for_each(|storey| spread(&|p| p.ride_s[storey], 3.0, 12.0));
    }
}
