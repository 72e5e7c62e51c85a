//! The way the camera goes: a closed path, a gaze, and the tremor of the hand that holds it.

use crate::building::{self, Proportions, Way};
use crate::solid::Carried;
use crate::{RATE_HZ, SceneName, random};
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{PI, TAU};
use tessera_geometry::Pose;

/// Position and gaze without tremor. World axes: z up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Gaze {
    pub(super) position: Vector3<f64>,
    /// Direction of view in the horizontal plane, radians from x towards y.
    pub(super) yaw: f64,
    /// Tilt of the view below the horizon, radians.
    pub(super) pitch: f64,
}

/// A camera's way through a scene, a function of time alone.
#[derive(Clone, Debug)]
pub(super) struct Walk {
    route: Route,
    /// Seconds of one way round; the pose after it is the first again.
    lap_s: f64,
    /// Seconds of the way in a second.
    speed: f64,
    tremor: [Vec<Wave>; 6],
}

/// Where the way leads.
#[derive(Clone, Debug)]
enum Route {
    /// A function of the lap alone.
    Round(fn(f64) -> Gaze),
    /// Through the building.
    Building(Box<Way>),
}

/// One part of the tremor.
#[derive(Clone, Copy, Debug)]
struct Wave {
    rate_hz: f64,
    phase: f64,
    amplitude: f64,
    /// Parts that do not fit the lap fade in after the first one.
    fits_lap: bool,
}

/// Frequency in hertz, amplitude of position in metres and of angles in radians: the slow drift
/// of an arm, breathing and steps, the muscle's tremor.
const TREMOR: [(f64, f64, f64); 4] =
    [(0.45, 0.011, 0.012), (1.1, 0.0045, 0.0045), (2.1, 0.0016, 0.0016), (4.3, 0.0003, 0.0005)];

impl Walk {
    pub(super) fn new(scene: SceneName, seed: u64, proportions: Proportions) -> Self {
        let lap_s = (scene.default_frames() - 1) as f64 / RATE_HZ;
        let key = random::word(seed, 0x7e4d);
        let tremor = std::array::from_fn(|axis| {
            let mut waves = Vec::new();
            for (k, (rate_hz, metres, radians)) in TREMOR.into_iter().enumerate() {
                let at = (axis * TREMOR.len() + k) as u64;
                // A whole number of waves a lap, a different one for each axis.
                let n_waves = libm::round(rate_hz * lap_s * (0.8 + 0.4 * random::unit(key, 3 * at)));
                let amplitude = if axis < 3 { metres } else { radians };
                let phase = TAU * random::unit(key, 3 * at + 1);
                let rate_hz = n_waves / lap_s;
                waves.push(Wave { rate_hz, phase, amplitude, fits_lap: true });
                let phase = TAU * random::unit(key, 3 * at + 2);
                waves.push(Wave {
                    rate_hz: rate_hz * 0.618,
                    phase,
                    amplitude: 0.4 * amplitude,
                    fits_lap: false,
                });
            }
            waves
        });
        let route = match scene {
            SceneName::Room => Route::Round(room_gaze),
            SceneName::Corridor => Route::Round(corridor_gaze),
            SceneName::Wall => Route::Round(wall_gaze),
            SceneName::House => Route::Round(house_gaze),
            SceneName::Building => Route::Building(Box::new(Way::new(lap_s, proportions))),
        };
        Self { route, lap_s, speed: 1.0, tremor }
    }

    /// The same way without the hand's tremor.
    #[cfg(test)]
    pub(super) fn steady(self) -> Self {
        Self { tremor: Default::default(), ..self }
    }

    /// The way through the building.
    #[cfg(test)]
    pub(super) fn building(&self) -> &Way {
        match &self.route {
            Route::Building(way) => way,
            Route::Round(_) => panic!("this is no way through the building"),
        }
    }

    /// The same way, so many times faster.
    pub(super) fn at_speed(self, speed: f64) -> Self {
        Self { speed, ..self }
    }

    /// Seconds of the way that lie behind at a time.
    pub(super) fn way_s(&self, time_s: f64) -> f64 {
        time_s * self.speed
    }

    /// The camera's pose at a time in seconds.
    pub(super) fn world_from_camera(&self, time_s: f64) -> Pose {
        let time_s = self.way_s(time_s);
        let gaze = self.gaze(time_s);
        let [dx, dy, dz, dyaw, dpitch, roll] = std::array::from_fn(|axis| self.tremor_of(axis, time_s));
        let (yaw, pitch) = (gaze.yaw + dyaw, gaze.pitch + dpitch);
        let forward = Vector3::new(
            libm::cos(yaw) * libm::cos(pitch),
            libm::sin(yaw) * libm::cos(pitch),
            -libm::sin(pitch),
        );
        let right = Vector3::new(libm::sin(yaw), -libm::cos(yaw), 0.0);
        let level = Matrix3::from_columns(&[right, forward.cross(&right), forward]);
        let (s, c) = (libm::sin(roll), libm::cos(roll));
        let rolled = level * Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rolled));
        Pose::from_parts(Translation3::from(gaze.position + Vector3::new(dx, dy, dz)), rotation)
    }

    /// The way without tremor.
    pub(super) fn gaze(&self, time_s: f64) -> Gaze {
        match &self.route {
            Route::Round(gaze) => gaze(TAU * time_s / self.lap_s),
            Route::Building(way) => way.gaze(time_s),
        }
    }

    /// Height of the floor under the camera at a time, metres.
    pub(super) fn floor_m(&self, time_s: f64) -> f64 {
        match &self.route {
            Route::Round(_) => 0.0,
            Route::Building(way) => way.height_m(time_s),
        }
    }

    /// Where what moves by itself is at a time.
    pub(super) fn carried(&self, time_s: f64) -> Carried {
        match &self.route {
            Route::Round(_) => Carried::default(),
            Route::Building(way) => building::carried(way, self.way_s(time_s), time_s),
        }
    }

    fn tremor_of(&self, axis: usize, time_s: f64) -> f64 {
        let later = ((time_s - self.lap_s) / self.lap_s).clamp(0.0, 1.0);
        let fade = later * later * (3.0 - 2.0 * later);
        let waves = self.tremor[axis].iter();
        waves
            .filter(|wave| wave.fits_lap || fade > 0.0)
            .map(|wave| {
                let strength = if wave.fits_lap { 1.0 } else { fade };
                strength * wave.amplitude * libm::sin(TAU * wave.rate_hz * time_s + wave.phase)
            })
            .sum()
    }
}

/// Once round on the spot, held at arm's length.
fn room_gaze(turn: f64) -> Gaze {
    let yaw = turn + 0.05 * libm::sin(2.0 * turn);
    Gaze {
        position: Vector3::new(
            0.45 * libm::cos(yaw),
            0.38 * libm::sin(yaw),
            1.36 + 0.08 * libm::sin(2.0 * turn),
        ),
        yaw,
        pitch: 0.25 + 0.06 * libm::sin(3.0 * turn),
    }
}

/// Forward and back along x.
fn corridor_gaze(turn: f64) -> Gaze {
    Gaze {
        position: Vector3::new(-0.6 * libm::cos(turn), 0.08 * libm::sin(2.0 * turn), 1.4),
        yaw: 0.12 * libm::sin(turn),
        pitch: 0.1,
    }
}

/// Round in a plane 1.6 m before the wall, which lies at x = 1.6.
fn wall_gaze(turn: f64) -> Gaze {
    Gaze {
        position: Vector3::new(0.05 * libm::sin(turn), 0.55 * libm::cos(turn), 1.5 + 0.3 * libm::sin(turn)),
        yaw: 0.08 * libm::sin(2.0 * turn),
        pitch: 0.05 * libm::cos(turn),
    }
}

/// Half sides of the rounded rectangle that the house's loop follows, metres.
pub(super) const HOUSE_HALF: [f64; 2] = [2.5, 4.5];
const HOUSE_CORNER_M: f64 = 1.1;

/// Length of the house's loop, metres.
fn house_length_m() -> f64 {
    let [half_x, half_y] = HOUSE_HALF;
    4.0 * (half_x + half_y - 2.0 * HOUSE_CORNER_M) + TAU * HOUSE_CORNER_M
}

/// Along a rounded rectangle through all rooms.
fn house_gaze(turn: f64) -> Gaze {
    let lap = turn / TAU;
    let length_m = house_length_m();
    let along_m = lap * length_m;
    let (xy, _) = house_track(along_m);
    // The view turns before the feet do: the mean direction of the next and last steps.
    const STEPS: i32 = 12;
    let yaw = (-STEPS..=STEPS).map(|k| house_track(along_m + 0.25 + 0.06 * f64::from(k)).1).sum::<f64>()
        / f64::from(2 * STEPS + 1);
    Gaze {
        position: Vector3::new(xy[0], xy[1], 1.4 + 0.04 * libm::sin(8.0 * TAU * lap)),
        yaw: yaw + 0.15 * libm::sin(5.0 * TAU * lap),
        pitch: 0.2 + 0.05 * libm::sin(7.0 * TAU * lap),
    }
}

/// Position and direction (unwrapped, radians) after `along_m` metres, counter-clockwise from the
/// middle of the right side.
fn house_track(along_m: f64) -> ([f64; 2], f64) {
    let [half_x, half_y] = HOUSE_HALF;
    let r = HOUSE_CORNER_M;
    let length_m = house_length_m();
    let laps = libm::floor(along_m / length_m);
    let mut rest = along_m - laps * length_m;
    let turned = laps * TAU;
    let quarter = 0.5 * PI * r;
    // Straight parts end to end with corners: (start, direction, length of the straight).
    let sides = [
        ([half_x, 0.0], 0.25, half_y - r),
        ([half_x - r, half_y], 0.5, 2.0 * (half_x - r)),
        ([-half_x, half_y - r], 0.75, 2.0 * (half_y - r)),
        ([-half_x + r, -half_y], 1.0, 2.0 * (half_x - r)),
        ([half_x, -half_y + r], 1.25, half_y - r),
    ];
    for (at, (start, direction, straight)) in sides.into_iter().enumerate() {
        let direction = direction * TAU;
        let (s, c) = (libm::sin(direction), libm::cos(direction));
        if rest <= straight || at == 4 {
            return ([start[0] + c * rest, start[1] + s * rest], turned + direction);
        }
        rest -= straight;
        if rest <= quarter {
            let angle = rest / r;
            let end = [start[0] + c * straight, start[1] + s * straight];
            let (forward, left) = (r * libm::sin(angle), r * (1.0 - libm::cos(angle)));
            let xy = [end[0] + c * forward - s * left, end[1] + s * forward + c * left];
            return (xy, turned + direction + angle);
        }
        rest -= quarter;
    }
    ([half_x, 0.0], turned + 0.25 * TAU)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::translation_rotation_norms;

    #[test]
    fn every_way_is_closed_and_no_faster_than_a_hand() {
        for scene in SceneName::ALL {
            let walk = Walk::new(scene, 1, Proportions::drawn(0));
            let n = scene.default_frames();
            let start = walk.world_from_camera(0.0);
            let end = walk.world_from_camera((n - 1) as f64 / RATE_HZ);
            let (apart_m, apart_rad) = translation_rotation_norms(&(start.inverse() * end));
            assert!(apart_m < 1e-6 && apart_rad < 1e-6, "{scene:?}: {apart_m} {apart_rad}");
            let (mut fastest_m, mut fastest_rad) = (0.0f64, 0.0f64);
            let step_s = 0.01;
            for k in 0..(n as f64 / RATE_HZ / step_s) as u64 {
                let at = |k: u64| walk.world_from_camera(k as f64 * step_s);
                let (metres, radians) = translation_rotation_norms(&(at(k).inverse() * at(k + 1)));
                fastest_m = fastest_m.max(metres / step_s);
                fastest_rad = fastest_rad.max(radians / step_s);
            }
            // The building is walked through; its lift rides at up to 1.1 m/s.
            let (most_m, most_rad) = if scene == SceneName::Building { (1.25, 1.1) } else { (0.60, 0.75) };
            assert!(
                fastest_m < most_m && fastest_rad < most_rad,
                "{scene:?}: {fastest_m} m/s, {fastest_rad} rad/s"
            );
        }
    }

    #[test]
    fn the_houses_loop_is_longer_than_25_m() {
        assert!(house_length_m() > 25.0, "{}", house_length_m());
        let mut before = house_track(-0.01).0;
        for k in 0..=3000 {
            let here = house_track(f64::from(k) * 0.01).0;
            let step = libm::hypot(here[0] - before[0], here[1] - before[1]);
            assert!((step - 0.01).abs() < 1e-4, "at {k}: {step}");
            before = here;
        }
    }

    #[test]
    fn the_camera_looks_level_and_ahead() {
        let pose = Walk::new(SceneName::Room, 1, Proportions::drawn(0)).world_from_camera(0.0);
        let ahead = pose.rotation * Vector3::z();
        let down = pose.rotation * Vector3::y();
        assert!(ahead.x > 0.9 && ahead.z < -0.1 && down.z < -0.9, "{ahead} {down}");
    }
}
