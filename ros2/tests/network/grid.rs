//! The occupancy grid in the network is that of the run's map.

use crate::common::{Network, Setup};
use crate::images::{base_from_camera, room};
use crate::map::{base64, near, written};
use nalgebra::Point3;
use serde_json::Value;

/// Edge of a cell and the band of heights by default, metres.
const CELL_M: f64 = 0.05;
const BAND_M: [f64; 2] = [0.1, 1.0];

/// A grid as a reader puts it together.
struct Grid {
    origin: [f64; 2],
    size: [usize; 2],
    cells: Vec<i8>,
}

fn pair(value: &Value) -> [usize; 2] {
    [0, 1].map(|k| value[k].as_u64().unwrap() as usize)
}

fn cells(line: &Value) -> Vec<i8> {
    base64(line["data"].as_str().unwrap()).into_iter().map(|byte| byte as i8).collect()
}

impl Grid {
    fn whole(line: &Value) -> Self {
        assert!((line["cell"].as_f64().unwrap() - CELL_M).abs() < 1e-6);
        let origin: Vec<f64> =
            line["origin"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
        assert_eq!(origin[2..], [0.0, 0.0, 0.0, 0.0, 1.0]);
        let (size, cells) = (pair(&line["size"]), cells(line));
        assert_eq!(cells.len(), size[0] * size[1]);
        assert!(cells.iter().all(|cell| [-1, 0, 100].contains(cell)));
        Self { origin: [origin[0], origin[1]], size, cells }
    }

    fn patch(&mut self, line: &Value) {
        let ([x, y], [width, height], cells) = (pair(&line["at"]), pair(&line["size"]), cells(line));
        assert!(x + width <= self.size[0] && y + height <= self.size[1] && cells.len() == width * height);
        for (row, cells) in cells.chunks(width).enumerate() {
            let begin = (y + row) * self.size[0] + x;
            self.cells[begin..begin + width].copy_from_slice(cells);
        }
    }

    fn centre(&self, at: usize) -> [f64; 2] {
        let place = [at % self.size[0], at / self.size[0]];
        [0, 1].map(|k| self.origin[k] + (place[k] as f64 + 0.5) * CELL_M)
    }

    fn at(&self, point: &Point3<f64>) -> i8 {
        let [x, y] = [0, 1].map(|k| ((point[k] - self.origin[k]) / CELL_M).floor());
        let is_inside = x >= 0.0 && y >= 0.0 && (x as usize) < self.size[0] && (y as usize) < self.size[1];
        if is_inside { self.cells[y as usize * self.size[0] + x as usize] } else { -1 }
    }
}

#[test]
fn the_grid_goes_out_whole_and_in_parts_and_late_readers_get_it() {
    let Some(network) = Network::new() else { return };
    let setup = Setup::new(120);
    room(setup.frames());
    let run = setup.start();
    // A cloud of more than a datagram.
    let ros2 = network.join(&setup, &["--map-spacing", "0.01"]);
    let camera = network.camera(&setup, &[]);
    (0..3).for_each(|_| setup.wait_for_growth("the first frames"));
    // While nothing changes any more, one who comes late gets the map. With no reader any more what the
    // thread held is given back, and made again for the next one.
    drop(camera);
    network.listen(&["map", "once"]).await_end();
    std::thread::sleep(std::time::Duration::from_secs(2));
    let listener = network.listen(&["map"]);
    let late = network.listen(&["map", "once"]).await_end();
    let camera = network.camera(&setup, &["--start", "200"]);
    setup.finish(run);
    let words = ros2.finish();
    drop(camera);
    let lines = listener.finish();
    for line in late.iter().chain(&lines).filter(|line| line["topic"] != "ready") {
        assert_eq!(line["same"], true, "{line}");
    }
    let cloud = late.iter().find(|line| line["topic"] == "/tessera/map_cloud").expect("a cloud");
    assert!(cloud["length"].as_u64().unwrap() > 66_000, "{}", cloud["length"]);
    let first = late.iter().find(|line| line["topic"] == "/tessera/grid").map(Grid::whole);
    assert!(first.unwrap().cells.contains(&100));
    let (mut grid, mut whole_at): (Option<Grid>, Option<i64>) = (None, None);
    let mut n_parts = 0;
    for line in &lines {
        match line["topic"].as_str().unwrap() {
            "/tessera/grid" => (grid, whole_at) = (Some(Grid::whole(line)), line["stamp"].as_i64()),
            // Two topics have no common order: a part says nothing of a grid that is newer.
            "/tessera/grid_updates" if whole_at.is_some() && line["stamp"].as_i64() > whole_at => {
                grid.as_mut().expect("there is a whole grid, for it has a time").patch(line);
                n_parts += 1;
            }
            _ => continue,
        }
        assert_eq!(line["frame"], "map");
    }
    assert!(n_parts > 0, "{words}");
    compare(&setup, &grid.expect("a grid"));
}

/// The last grid against `map.ply` and the trajectory.
fn compare(setup: &Setup, grid: &Grid) {
    let written = written(setup);
    let obstacles = || written.iter().filter(|point| (BAND_M[0]..BAND_M[1]).contains(&point.z));
    let flat = |x: f64, y: f64| Point3::new(x, y, 0.0);
    let is_obstacle = near(obstacles().map(|point| flat(point.x, point.y)));
    let occupied: Vec<usize> = (0..grid.cells.len()).filter(|at| grid.cells[*at] == 100).collect();
    assert!(occupied.len() > 20, "{} cells are occupied", occupied.len());
    for at in &occupied {
        let [x, y] = grid.centre(*at);
        assert!(is_obstacle(&flat(x, y)), "no point of map.ply at {x} {y}");
    }
    let is_occupied = near(occupied.iter().map(|at| grid.centre(*at)).map(|[x, y]| flat(x, y)));
    // Not where one keyframe alone saw something that others saw through.
    let n_shown = obstacles().filter(|point| is_occupied(&flat(point.x, point.y))).count();
    let n = obstacles().count();
    assert!(n_shown as f64 > 0.95 * n as f64, "{n_shown} of {n} obstacles are in the grid");
    let n_free = grid.cells.iter().filter(|cell| **cell == 0).count();
    assert!(n_free > 500, "{n_free} cells are free");
    // Where the camera was there is no obstacle.
    let text = std::fs::read_to_string(setup.out().join("trajectory.txt")).unwrap();
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let numbers: Vec<f64> = line.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect();
        let place = base_from_camera() * Point3::new(numbers[0], numbers[1], numbers[2]);
        assert_ne!(grid.at(&place), 100, "{line}");
    }
}
