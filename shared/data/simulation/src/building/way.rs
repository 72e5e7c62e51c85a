//! The way through the building: on each storey all rooms and twice the corridor, then the lift.

use super::{CABIN_M, COLUMNS_M, LOBBY_END_M, N_STOREYS, Proportions, ROOM_M, ROWS_END_M, STOREY_M};
use crate::path::Gaze;
use crate::track::Track;
use nalgebra::Vector3;
use std::f64::consts::{PI, TAU};

/// Radius of a corner, metres.
const CORNER_M: f64 = 0.5;
/// Half side of the round in a room.
const ROUND_M: f64 = 1.1;
/// Time from standing to walking, seconds.
const START_S: f64 = 1.5;
/// Height of the camera above the floor, metres, and its tilt, radians.
const EYE_M: f64 = 1.4;
const TILT_RAD: f64 = 0.2;

/// The way of one lap, by time.
#[derive(Clone, Debug)]
pub(crate) struct Way {
    proportions: Proportions,
    track: Track,
    /// Distance at which the first room begins, and from there to the next one, metres.
    first_room_m: f64,
    room_m: f64,
    /// Time on one storey, seconds.
    storey_s: f64,
    lap_s: f64,
}

/// A moment of the way.
enum WayMoment {
    /// Walking on a storey for so many seconds.
    Walk { storey: usize, walked_s: f64 },
    /// In the lift, so many seconds after arriving in it from this storey.
    Lift { storey: usize, stood_s: f64 },
}

impl Way {
    /// The way in a lap of so many seconds.
    pub(crate) fn new(lap_s: f64, proportions: Proportions) -> Self {
        let row_m = proportions.row_m();
        let track = Track::new(&points(row_m), CORNER_M);
        let in_lift_s: f64 = (0..N_STOREYS).map(|storey| proportions.stop_s(storey)).sum();
        let door = |room: usize| track.distance_to([COLUMNS_M[room] - 0.5 * ROOM_M, row_m]).unwrap_or(0.0);
        let [first, second] = [door(0), door(1)];
        Self {
            proportions,
            track,
            first_room_m: first,
            room_m: second - first,
            storey_s: (lap_s - in_lift_s) / N_STOREYS as f64,
            lap_s,
        }
    }

    /// Those of the building that it leads through.
    pub(super) fn proportions(&self) -> &Proportions {
        &self.proportions
    }

    /// Metres walked in a lap.
    #[cfg(test)]
    pub(crate) fn walked_m(&self) -> f64 {
        self.track.length_m() * N_STOREYS as f64
    }

    /// Position and gaze, without tremor, in the world.
    pub(crate) fn gaze(&self, time_s: f64) -> Gaze {
        let (along_m, turned) = match self.moment(time_s) {
            WayMoment::Walk { walked_s, .. } => (self.along_m(walked_s), 0.0),
            WayMoment::Lift { stood_s, .. } => {
                (self.track.length_m(), PI * eased(stood_s / self.proportions.turn_s))
            }
        };
        let gaze = self.gaze_at(along_m);
        let lift = Vector3::new(0.0, 0.0, self.height_m(time_s));
        Gaze { position: gaze.position + lift, yaw: gaze.yaw + turned, ..gaze }
    }

    /// Height of the floor that the camera stands on, metres: that of the cabin while it rides.
    pub(crate) fn height_m(&self, time_s: f64) -> f64 {
        match self.moment(time_s) {
            WayMoment::Walk { storey, .. } => storey as f64 * STOREY_M,
            WayMoment::Lift { storey, stood_s } => {
                let next = (storey + 1) % N_STOREYS;
                let Proportions { turn_s, door_s, ride_s, .. } = self.proportions;
                let ridden = eased((stood_s - turn_s - door_s) / ride_s[storey]);
                (storey as f64 + ridden * (next as f64 - storey as f64)) * STOREY_M
            }
        }
    }

    /// How far the lift's door is closed, 0 to 1.
    pub(crate) fn door(&self, time_s: f64) -> f64 {
        match self.moment(time_s) {
            WayMoment::Walk { .. } => 0.0,
            WayMoment::Lift { storey, stood_s } => {
                let Proportions { turn_s, door_s, ride_s, .. } = self.proportions;
                let closed = eased((stood_s - turn_s) / door_s);
                closed - eased((stood_s - turn_s - door_s - ride_s[storey]) / door_s)
            }
        }
    }

    /// When a share of the way through a room of the northern row, by number, has been walked on a storey.
    #[cfg(test)]
    pub(crate) fn in_room_s(&self, storey: usize, room: usize, share: f64) -> f64 {
        let along_m = self.first_room_m + (room as f64 + share) * self.room_m;
        let speed = self.track.length_m() / (self.storey_s - START_S);
        let before_s: f64 = (0..storey).map(|before| self.storey_s + self.proportions.stop_s(before)).sum();
        before_s + along_m / speed + 0.5 * START_S
    }

    /// When a share of the ride from a storey is over.
    #[cfg(test)]
    pub(crate) fn in_ride_s(&self, storey: usize, share: f64) -> f64 {
        let Proportions { turn_s, door_s, ride_s, .. } = self.proportions;
        let before_s: f64 = (0..storey).map(|before| self.storey_s + self.proportions.stop_s(before)).sum();
        before_s + self.storey_s + turn_s + door_s + share * ride_s[storey]
    }

    fn moment(&self, time_s: f64) -> WayMoment {
        let mut rest_s = time_s - self.lap_s * libm::floor(time_s / self.lap_s);
        for storey in 0..N_STOREYS {
            if rest_s < self.storey_s {
                return WayMoment::Walk { storey, walked_s: rest_s };
            }
            rest_s -= self.storey_s;
            let stop_s = self.proportions.stop_s(storey);
            if rest_s < stop_s {
                return WayMoment::Lift { storey, stood_s: rest_s };
            }
            rest_s -= stop_s;
        }
        WayMoment::Walk { storey: 0, walked_s: 0.0 }
    }

    /// Distance walked on a storey: one speed, with a start and an end.
    fn along_m(&self, walked_s: f64) -> f64 {
        let speed = self.track.length_m() / (self.storey_s - START_S);
        let from_rest = |s: f64| if s < START_S { 0.5 * s * s / START_S } else { s - 0.5 * START_S };
        let left_s = self.storey_s - walked_s;
        if left_s < START_S {
            self.track.length_m() - speed * from_rest(left_s)
        } else {
            speed * from_rest(walked_s)
        }
    }

    /// Gaze on the ground storey. It wanders by the place in a room, so that it is the same in each.
    fn gaze_at(&self, along_m: f64) -> Gaze {
        let (xy, _) = self.track.at(along_m);
        // The view turns before the feet do: the mean direction of the next and last steps.
        const STEPS: i32 = 12;
        let direction = |k: i32| self.track.at(along_m + 0.25 + 0.08 * f64::from(k)).1;
        let yaw = (-STEPS..=STEPS).map(direction).sum::<f64>() / f64::from(2 * STEPS + 1);
        let wander = |waves: f64| libm::sin(TAU * waves * (along_m - self.first_room_m) / self.room_m);
        let calm = eased(0.5 * along_m) * eased(0.5 * (self.track.length_m() - along_m));
        Gaze {
            position: Vector3::new(xy[0], xy[1], EYE_M + 0.04 * calm * wander(5.0)),
            yaw: yaw + 0.12 * calm * wander(3.0),
            pitch: TILT_RAD + 0.05 * calm * wander(2.0),
        }
    }
}

/// From 0 to 1 and at rest at both ends.
fn eased(share: f64) -> f64 {
    let share = share.clamp(0.0, 1.0);
    share * share * (3.0 - 2.0 * share)
}

/// Corners of the way on one storey, from the cabin to the cabin.
fn points(row_m: f64) -> Vec<[f64; 2]> {
    let lobby_m = 0.5 * (ROWS_END_M + LOBBY_END_M);
    let mut points = vec![[CABIN_M, 0.0], [-lobby_m, 0.0]];
    for row_m in [row_m, -row_m] {
        points.push([-lobby_m, row_m]);
        points.extend(COLUMNS_M.into_iter().flat_map(|x| round(x, row_m)));
        points.extend([[lobby_m, row_m], [lobby_m, 0.0], [-lobby_m, 0.0]]);
    }
    points.pop();
    points.push([CABIN_M, 0.0]);
    points
}

/// In by the western door, once round the table, and on to the eastern door.
fn round(x: f64, y: f64) -> [[f64; 2]; 9] {
    const R: f64 = ROUND_M;
    let door = [-0.5 * ROOM_M, 0.0];
    [door, [-R, 0.0], [-R, -R], [R, -R], [R, R], [-R, R], [-R, -R], [R, -R], [R, 0.0]]
        .map(|[east, north]| [x + east, y + north])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{RATE_HZ, SceneName};

    fn of_proportions(seed: u64) -> Way {
        let lap_s = (SceneName::Building.default_frames() - 1) as f64 / RATE_HZ;
        Way::new(lap_s, Proportions::drawn(seed))
    }

    #[test]
    fn a_lap_is_longer_than_500_m() {
        let walked_m = of_proportions(0).walked_m();
        assert!(walked_m > 500.0, "{walked_m} m");
    }

    #[test]
    fn rooms_are_walked_alike() {
        (0..6).map(of_proportions).for_each(|way| check_rooms(&way));
    }

    fn check_rooms(way: &Way) {
        assert!((10.0..20.0).contains(&way.room_m), "{} m", way.room_m);
        // The view still turns with the lobby's corner in the first steps.
        for k in 10..100 {
            let along_m = way.first_room_m + f64::from(k) * 0.01 * way.room_m;
            let [first, next] = [0.0, way.room_m].map(|more_m| way.gaze_at(along_m + more_m));
            let apart = next.position - first.position;
            assert!((apart - Vector3::new(ROOM_M, 0.0, 0.0)).norm() < 1e-9, "{apart}");
            let turned = (next.yaw - first.yaw).rem_euclid(TAU);
            assert!(turned < 1e-9 || TAU - turned < 1e-9, "{turned} rad at {k} %");
        }
    }

    #[test]
    fn the_lift_carries_the_camera_behind_a_closed_door() {
        (0..6).map(of_proportions).for_each(|way| check_lift(&way));
    }

    fn check_lift(way: &Way) {
        let mut heights = Vec::new();
        // A little more than a lap, for its last ride.
        let n = ((way.lap_s + 5.0) * 20.0) as u32;
        for k in 0..n {
            let [before, now] = [k, k + 1].map(|k| f64::from(k) * 0.05);
            if way.height_m(now) != way.height_m(before) {
                assert!(way.door(before) > 0.99 && way.door(now) > 0.99, "at {now} s");
            } else if way.door(now) == 0.0 && heights.last() != Some(&way.height_m(now)) {
                heights.push(way.height_m(now));
            }
        }
        assert_eq!(heights, [0.0, STOREY_M, 2.0 * STOREY_M, 0.0]);
    }
}
