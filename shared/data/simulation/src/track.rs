//! A way of straight parts joined by arcs, by the distance along it.

use std::f64::consts::{PI, TAU};

/// A rounded polyline in the plane.
#[derive(Clone, Debug)]
pub(super) struct Track {
    pieces: Vec<TrackPiece>,
    length_m: f64,
}

/// A straight part or an arc.
#[derive(Clone, Copy, Debug)]
struct TrackPiece {
    /// Distance from the start of the track to its own, metres.
    from_m: f64,
    start: [f64; 2],
    /// Direction at its start, unwrapped, radians.
    direction: f64,
    /// Radians per metre, positive to the left; 0: straight.
    curvature: f64,
}

impl TrackPiece {
    fn at(&self, along_m: f64) -> ([f64; 2], f64) {
        let (s, c) = (libm::sin(self.direction), libm::cos(self.direction));
        let (forward, left) = if self.curvature == 0.0 {
            (along_m, 0.0)
        } else {
            let angle = self.curvature * along_m;
            (libm::sin(angle) / self.curvature, (1.0 - libm::cos(angle)) / self.curvature)
        };
        let xy = [self.start[0] + c * forward - s * left, self.start[1] + s * forward + c * left];
        (xy, self.direction + self.curvature * along_m)
    }
}

impl Track {
    /// The polyline through `points`, its corners rounded with `radius_m`. Neighbouring corners must leave
    /// room for both arcs.
    pub(super) fn new(points: &[[f64; 2]], radius_m: f64) -> Self {
        let mut track = Self { pieces: Vec::new(), length_m: 0.0 };
        let heading = |from: [f64; 2], to: [f64; 2]| libm::atan2(to[1] - from[1], to[0] - from[0]);
        let mut direction = heading(points[0], points[1]);
        let mut start = points[0];
        for at in 1..points.len() {
            let corner = points[at];
            let turn = points.get(at + 1).map_or(0.0, |next| {
                let turn = heading(corner, *next) - direction;
                turn - TAU * libm::floor((turn + PI) / TAU)
            });
            let cut_m = radius_m * libm::tan(0.5 * turn.abs());
            let straight_m = libm::hypot(corner[0] - start[0], corner[1] - start[1]) - cut_m;
            debug_assert!(straight_m > -1e-9, "no room for the arc at {corner:?}");
            (start, direction) = track.push(start, direction, 0.0, straight_m);
            if turn.abs() > 1e-9 {
                let curvature = turn.signum() / radius_m;
                (start, direction) = track.push(start, direction, curvature, radius_m * turn.abs());
            }
        }
        track
    }

    /// Adds a piece and returns where it ends.
    fn push(&mut self, start: [f64; 2], direction: f64, curvature: f64, length_m: f64) -> ([f64; 2], f64) {
        let piece = TrackPiece { from_m: self.length_m, start, direction, curvature };
        self.pieces.push(piece);
        self.length_m += length_m;
        piece.at(length_m)
    }

    /// Length, metres.
    pub(super) fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Distance at which a straight part first begins at this point, one of those that it was made of.
    pub(super) fn distance_to(&self, point: [f64; 2]) -> Option<f64> {
        let is_there =
            |piece: &&TrackPiece| libm::hypot(piece.start[0] - point[0], piece.start[1] - point[1]) < 1e-6;
        self.pieces.iter().find(is_there).map(|piece| piece.from_m)
    }

    /// Position and direction (unwrapped, radians) after a distance; its ends beyond them.
    pub(super) fn at(&self, along_m: f64) -> ([f64; 2], f64) {
        let along_m = along_m.clamp(0.0, self.length_m);
        let place = self.pieces.partition_point(|piece| piece.from_m <= along_m);
        let piece = &self.pieces[place.saturating_sub(1)];
        piece.at(along_m - piece.from_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_track_is_as_long_as_it_says_and_turns_as_its_corners_do() {
        let points = [[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [2.0, 3.0], [4.0, 3.0], [4.0, 5.0]];
        let track = Track::new(&points, 0.5);
        // Three corners of 90 degrees.
        assert!((track.length_m() - (9.0 - 3.0 * (1.0 - 0.25 * PI))).abs() < 1e-9, "{}", track.length_m());
        let (end, direction) = track.at(100.0);
        assert!(libm::hypot(end[0] - 4.0, end[1] - 5.0) < 1e-9 && (direction - 0.5 * PI).abs() < 1e-9);
        let middle_m = track.distance_to([2.0, 1.5]).unwrap();
        assert!((middle_m - (3.5 - (1.0 - 0.25 * PI))).abs() < 1e-9, "{middle_m}");
        let mut before = track.at(0.0).0;
        for k in 1..=(track.length_m() * 100.0) as u32 {
            let here = track.at(f64::from(k) * 0.01).0;
            let step_m = libm::hypot(here[0] - before[0], here[1] - before[1]);
            assert!((step_m - 0.01).abs() < 1e-4, "at {k}: {step_m}");
            before = here;
        }
    }
}
