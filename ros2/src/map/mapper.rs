//! The grid as keyframes come and move: what it shows is a function of keyframes and poses, and time
//! alone decides when it is shown.

use super::follow::FollowedKeyframes;
use super::pace::MapPace;
use std::time::{Duration, Instant};
use tessera_occupancy::{CellLattice, CellVotes, ColouredPoint, GridPart, OccupancyCells, RayScan};

/// Least time between two times that all rays are cast again.
const RECAST: Duration = Duration::from_secs(5);
/// Least time between two whole grids.
const WHOLE: Duration = Duration::from_secs(2);

/// What is to be published of the grid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum GridUpdate {
    /// All of it.
    Whole(OccupancyCells),
    /// What changed since the last update.
    Part(GridPart),
}

/// CellVotes of keyframes, and what was published of them.
pub(crate) struct GridMapper {
    lattice: CellLattice,
    votes: CellVotes,
    /// The keyframes that have voted, where they stood.
    cast: FollowedKeyframes,
    recast: MapPace,
    sent: Option<OccupancyCells>,
    /// The last whole grid is not the newest: what comes late would get an old one.
    is_old: bool,
    whole: MapPace,
}

impl GridMapper {
    /// No keyframe yet.
    pub(crate) fn new(lattice: CellLattice) -> Self {
        let votes = CellVotes::new(&lattice);
        let (recast, whole) = (MapPace::new(RECAST), MapPace::new(WHOLE));
        Self { lattice, votes, cast: FollowedKeyframes::new(), recast, sent: None, is_old: false, whole }
    }

    /// Takes in the keyframes as they stand now, whose points `held` has by id in their cameras' axes;
    /// `is_last` waits for nothing. Answers what is to be published.
    pub(crate) fn step(
        &mut self,
        scene: &FollowedKeyframes,
        held: &[Vec<ColouredPoint>],
        now: Instant,
        is_last: bool,
    ) -> Option<GridUpdate> {
        let has_changed = self.take(scene, held, now, is_last);
        let may_be_whole = is_last || self.whole.is_open(now);
        let is_whole_due = self.is_old && may_be_whole;
        if !has_changed && !is_whole_due {
            return None;
        }
        let grid = self.votes.grid()?;
        let before = self.sent.as_ref().filter(|before| grid.fits(before));
        if let Some(before) = before
            && !is_whole_due
        {
            let part = grid.change(before)?;
            (self.sent, self.is_old) = (Some(grid), true);
            return Some(GridUpdate::Part(part));
        }
        if !may_be_whole {
            // A part cannot say the new size: the whole grid does soon.
            self.is_old = true;
            return None;
        }
        self.whole.close(now, now, grid.cells.len());
        (self.sent, self.is_old) = (Some(grid.clone()), false);
        Some(GridUpdate::Whole(grid))
    }

    /// Casts rays of what is new, and of all where anything moved; whether there was any.
    fn take(
        &mut self,
        scene: &FollowedKeyframes,
        held: &[Vec<ColouredPoint>],
        now: Instant,
        is_last: bool,
    ) -> bool {
        if !scene.starts_with(&self.cast) {
            if !is_last && !self.recast.is_open(now) {
                return false;
            }
            self.votes = CellVotes::new(&self.lattice);
            self.cast.clear();
            let began = Instant::now();
            self.add(scene, held);
            self.recast.close(now, now + began.elapsed(), 0);
            return true;
        }
        let is_more = scene.len() > self.cast.len();
        self.add(scene, held);
        is_more
    }

    fn add(&mut self, scene: &FollowedKeyframes, held: &[Vec<ColouredPoint>]) {
        for (id, map_from_camera) in &scene[self.cast.len()..] {
            let points = held.get(*id as usize).into_iter().flatten();
            self.votes.add(&RayScan::of_keyframe(&self.lattice, map_from_camera, points));
        }
        self.cast.clone_from(scene);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::Pose;
    use tessera_occupancy::{FREE, OCCUPIED, PointThinner, UNKNOWN};

    /// Half of the room's length, width; the height of the box in it, all metres.
    const ROOM: [f64; 2] = [2.02, 1.52];
    const BOX_M: f64 = 0.33;

    /// What a camera 0.8 m above the floor sees of a room around the origin, with or without a box of 0.4 m
    /// before its wall at x = 2.02: points in the camera's axes, here those of the room.
    fn view(camera: [f64; 3], has_box: bool) -> Vec<ColouredPoint> {
        let mut thinner = PointThinner::new(0.025);
        for yaw in 0..720 {
            for pitch in -120..80 {
                let (yaw, pitch) =
                    ((f64::from(yaw) / 2.0).to_radians(), (f64::from(pitch) / 2.0).to_radians());
                let ray = [pitch.cos() * yaw.cos(), pitch.cos() * yaw.sin(), pitch.sin()];
                let to =
                    |axis: usize, plane: f64| Some((plane - camera[axis]) / ray[axis]).filter(|t| *t > 0.0);
                let at = |t: f64| [0, 1, 2].map(|axis| camera[axis] + t * ray[axis]);
                let walls = [0, 1].into_iter().flat_map(|k| [to(k, ROOM[k]), to(k, -ROOM[k])]);
                let is_box = |p: [f64; 3]| (1.2..1.6).contains(&p[0]) && p[1].abs() < 0.2 && p[2] < BOX_M;
                let sides = [to(0, 1.2), to(2, BOX_M)].map(|t| t.filter(|t| has_box && is_box(at(t + 1e-9))));
                let hits = walls.chain([to(2, 0.0), to(2, 2.4)]).chain(sides).flatten();
                let end = at(hits.fold(f64::INFINITY, f64::min));
                let position = [0, 1, 2].map(|axis| (end[axis] - camera[axis]) as f32);
                thinner.add(&ColouredPoint { position, rgb: [0; 3] });
            }
        }
        thinner.points()
    }

    fn lattice() -> CellLattice {
        CellLattice::new(0.05, (0.1, 1.0))
    }

    fn scene(cameras: &[[f64; 3]]) -> FollowedKeyframes {
        cameras.iter().zip(0..).map(|([x, y, z], id)| (id, Pose::translation(*x, *y, *z))).collect()
    }

    fn whole(cameras: &[[f64; 3]], held: &[Vec<ColouredPoint>]) -> OccupancyCells {
        let update = GridMapper::new(lattice()).step(&scene(cameras), held, Instant::now(), true);
        let Some(GridUpdate::Whole(grid)) = update else { panic!("{update:?}") };
        grid
    }

    fn at(grid: &OccupancyCells, x: f64, y: f64) -> u8 {
        let [column, row] = [x, y].map(|metres| (metres / 0.05).floor() as i32);
        let place = (row - grid.begin[1]) * grid.width as i32 + column - grid.begin[0];
        grid.cells[usize::try_from(place).unwrap()]
    }

    const CAMERAS: [[f64; 3]; 2] = [[0.01, 0.01, 0.8], [-0.5, 0.3, 0.8]];

    #[test]
    fn a_room_has_walls_a_free_inside_and_an_unknown_outside() {
        let held = CAMERAS.map(|camera| view(camera, true));
        let grid = whole(&CAMERAS, &held);
        for row in 0..grid.height as i32 {
            for column in 0..grid.width as i32 {
                let centre = |cells: i32| (f64::from(cells) + 0.5) * 0.05;
                let (x, y) = (centre(grid.begin[0] + column), centre(grid.begin[1] + row));
                let (to_x, to_y) = (x.abs() - ROOM[0], y.abs() - ROOM[1]);
                let beyond = to_x.max(to_y);
                let is_box = (1.21..1.59).contains(&x) && y.abs() < 0.19;
                let is_at_box_or_behind = x > 1.15 && y.abs() < 0.35;
                let expected = match beyond {
                    beyond if beyond > 0.05 => UNKNOWN,
                    // Corners may hide in the neighbouring cells.
                    _ if to_x > -0.05 && to_y > -0.05 => continue,
                    beyond if beyond > -0.025 && beyond < 0.025 => OCCUPIED,
                    _ if is_box => OCCUPIED,
                    beyond if beyond < -0.075 && !is_at_box_or_behind => FREE,
                    _ => continue,
                };
                assert_eq!(at(&grid, x, y), expected, "{x} {y}");
            }
        }
    }

    #[test]
    fn what_was_taken_away_is_free_again_and_what_is_seen_over_stays() {
        let held: Vec<Vec<ColouredPoint>> = (0..6).map(|id| view(CAMERAS[0], id < 1)).collect();
        let cameras = [CAMERAS[0]; 6];
        assert_eq!(at(&whole(&cameras[..1], &held), 1.4, 0.01), OCCUPIED);
        assert_eq!(at(&whole(&cameras, &held), 1.4, 0.01), FREE);
        let there = vec![view(CAMERAS[0], true); 6];
        assert_eq!(at(&whole(&cameras, &there), 1.4, 0.01), OCCUPIED);
    }

    #[test]
    fn keyframes_one_by_one_give_what_all_at_once_give_and_so_do_parts() {
        let held = CAMERAS.map(|camera| view(camera, true));
        let (all, now) = (whole(&CAMERAS, &held), Instant::now());
        let mut mapper = GridMapper::new(lattice());
        let first = mapper.step(&scene(&CAMERAS[..1]), &held, now, false);
        assert_eq!(first, Some(GridUpdate::Whole(whole(&CAMERAS[..1], &held))));
        assert_eq!(mapper.step(&scene(&CAMERAS[..1]), &held, now, true), None, "nothing is new");
        let Some(GridUpdate::Part(_)) = mapper.step(&scene(&CAMERAS), &held, now, false) else {
            panic!("the room's size is known")
        };
        // What comes late gets the newest one too, after a while.
        assert_eq!(mapper.step(&scene(&CAMERAS), &held, now, false), None);
        assert_eq!(mapper.step(&scene(&CAMERAS), &held, now + WHOLE, false), Some(GridUpdate::Whole(all)));
        // A correction moves a keyframe: as if it had always been there.
        let moved = [CAMERAS[0], [-0.4, 0.3, 0.8]];
        let part = mapper.step(&scene(&moved), &held, now + WHOLE, false);
        assert!(matches!(part, Some(GridUpdate::Part(_))), "{part:?}");
        let back = mapper.step(&scene(&CAMERAS), &held, now + WHOLE, false);
        assert_eq!(back, None, "all rays are cast again after a while");
        let last = mapper.step(&scene(&moved[..1]), &held, now, true);
        assert_eq!(last, Some(GridUpdate::Whole(whole(&CAMERAS[..1], &held))));
    }
}
