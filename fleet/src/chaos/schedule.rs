//! Faults in an order that a seed determines.

use serde::Serialize;
use std::time::Duration;
use tessera_numerics::SplitMix64;

/// What strikes a fleet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FleetFault {
    /// A link is cut, and no connection comes about for a while.
    Cut,
    /// What a link carries comes half a second late.
    Delay,
    /// A link carries 50 kB/s.
    Throttle,
    /// A piece comes twice in its stream, and attempts to connect come twice.
    Repeat,
    /// A robot connects anew, while what it sent before is still under way.
    Reconnect,
    /// SIGKILL of an uplink.
    KillUplink,
    /// SIGKILL of the base.
    KillBase,
}

impl FleetFault {
    /// All of them with their words.
    pub const ALL: [(Self, &'static str); 7] = [
        (Self::Cut, "link cut"),
        (Self::Delay, "link delayed by 500 ms"),
        (Self::Throttle, "link throttled to 50 kB/s"),
        (Self::Repeat, "bytes repeated"),
        (Self::Reconnect, "robot connected anew"),
        (Self::KillUplink, "uplink killed"),
        (Self::KillBase, "base killed"),
    ];

    /// How long it holds, milliseconds: at least, and how much more at most.
    fn holds_ms(self) -> (usize, usize) {
        match self {
            Self::Cut => (30, 300),
            Self::Delay | Self::Throttle => (300, 700),
            Self::Repeat => (500, 500),
            Self::Reconnect => (50, 150),
            Self::KillUplink | Self::KillBase => (0, 200),
        }
    }
}

/// One fault to come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct FleetStrike {
    /// What.
    pub fault: FleetFault,
    /// Which robot or its link, by its number from 0; for the base without a meaning.
    #[serde(skip)]
    pub robot: usize,
    /// How long it holds; of a process, how long it is away.
    #[serde(rename = "holds_ms", serialize_with = "as_ms")]
    pub holds: Duration,
    /// Until the next one, which may come while this one holds.
    #[serde(rename = "pause_ms", serialize_with = "as_ms")]
    pub pause: Duration,
}

fn as_ms<S: serde::Serializer>(time: &Duration, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(time.as_millis() as u64)
}

/// So many faults of each kind, shuffled.
pub fn schedule(seed: u64, times: u32, n_robots: usize) -> Vec<FleetStrike> {
    let mut random = SplitMix64::new(seed);
    let mut ms = |(least, more): (usize, usize)| Duration::from_millis((least + random.below(more)) as u64);
    let mut strikes: Vec<FleetStrike> = Vec::new();
    for _ in 0..times {
        for (fault, _) in FleetFault::ALL {
            strikes.push(FleetStrike { fault, robot: 0, holds: ms(fault.holds_ms()), pause: ms((10, 240)) });
        }
    }
    for place in (1..strikes.len()).rev() {
        strikes.swap(place, random.below(place + 1));
    }
    for strike in &mut strikes {
        strike.robot = random.below(n_robots);
    }
    strikes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_determines_the_faults_and_there_are_as_many_of_each_kind() {
        let strikes = schedule(7, 20, 3);
        assert_eq!(strikes, schedule(7, 20, 3));
        assert_ne!(strikes, schedule(8, 20, 3));
        for (fault, _) in FleetFault::ALL {
            assert_eq!(strikes.iter().filter(|strike| strike.fault == fault).count(), 20);
        }
        for robot in 0..3 {
            assert!(strikes.iter().any(|strike| strike.robot == robot));
        }
        let (first, second) = strikes.split_at(7);
        assert!(first.iter().zip(second).any(|(a, b)| a.fault != b.fault), "they are shuffled");
    }
}
