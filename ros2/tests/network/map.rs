//! The map in the network is the one that the run writes.

use crate::common::{Network, Setup};
use crate::images::base_from_camera;
use nalgebra::Point3;
use serde_json::Value;
use std::collections::{HashMap, HashSet};

/// Distance of neighbouring points by default, metres.
const SPACING_M: f64 = 0.05;
/// From a point to the mean of its voxel at most, and what a correction moves.
const NEAR_M: f64 = 0.1;

/// Positions and colours of a cloud.
fn points(line: &Value) -> Vec<(Point3<f64>, [u8; 3])> {
    let data = base64(line["data"].as_str().unwrap());
    let of = |bytes: &[u8]| {
        let metres = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
        (Point3::new(metres(0), metres(4), metres(8)), [bytes[14], bytes[13], bytes[12]])
    };
    data.chunks_exact(16).map(of).collect()
}

pub(crate) fn base64(text: &str) -> Vec<u8> {
    let digit = |byte: u8| match byte {
        b'A'..=b'Z' => byte - b'A',
        b'a'..=b'z' => byte - b'a' + 26,
        b'0'..=b'9' => byte - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let n_padded = text.bytes().filter(|byte| *byte == b'=').count();
    let mut bytes = Vec::new();
    for four in text.as_bytes().chunks(4) {
        let joined = four.iter().fold(0u32, |sum, byte| (sum << 6) | u32::from(digit(*byte)));
        bytes.extend(&joined.to_be_bytes()[1..]);
    }
    bytes.truncate(bytes.len() - n_padded);
    bytes
}

/// The points of `map.ply` in the frame `map`.
pub(crate) fn written(setup: &Setup) -> Vec<Point3<f64>> {
    let bytes = std::fs::read(setup.out().join("map.ply")).unwrap();
    let end = b"end_header\n";
    let begin = bytes.windows(end.len()).position(|window| window == end).unwrap() + end.len();
    let base = base_from_camera();
    let of = |bytes: &[u8]| {
        let metres = |at: usize| f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()));
        base * Point3::new(metres(0), metres(4), metres(8))
    };
    bytes[begin..].chunks_exact(27).map(of).collect()
}

/// Answers whether a point is near one of these.
pub(crate) fn near(points: impl Iterator<Item = Point3<f64>>) -> impl Fn(&Point3<f64>) -> bool {
    let cell = |point: &Point3<f64>| point.coords.map(|metres| (metres / NEAR_M).floor() as i64);
    let mut cells: HashMap<_, Vec<Point3<f64>>> = HashMap::new();
    points.for_each(|point| cells.entry(cell(&point)).or_default().push(point));
    move |point| {
        let own = cell(point);
        let around = |k: i64| own + nalgebra::Vector3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
        let mut there = (0..27).filter_map(|k| cells.get(&around(k))).flatten();
        there.any(|other| (other - point).norm() < NEAR_M)
    }
}

#[test]
fn the_map_goes_out_as_the_run_has_it() {
    let Some(network) = Network::new() else { return };
    let (setup, words, lines) = network.played(120, &["map"]);
    let of = |topic: &str| -> Vec<&Value> { lines.iter().filter(|line| line["topic"] == topic).collect() };
    assert!(lines.iter().filter(|line| line["topic"] != "ready").all(|line| line["same"] == true));
    let (keyframes, clouds) = (of("/tessera/map_points"), of("/tessera/map_cloud"));
    assert!(!keyframes.is_empty() && !clouds.is_empty(), "{words}");
    let written = written(&setup);
    let is_written = near(written.iter().copied());
    for line in keyframes.iter().chain(&clouds) {
        assert_eq!(line["frame"], "map");
        let fields = r#"[["x",0,7,1],["y",4,7,1],["z",8,7,1],["rgb",12,7,1]]"#;
        assert_eq!(line["fields"].to_string(), fields);
        let points = points(line);
        assert_eq!(
            line["shape"].to_string(),
            format!("[1,{0},16,{1},false,true]", points.len(), 16 * points.len())
        );
        let (n, n_far) = (points.len(), points.iter().filter(|(point, _)| !is_written(point)).count());
        assert!(n > 100 && n_far == 0, "{n_far} of {n} points are not in map.ply");
        assert!(points.iter().any(|(_, rgb)| *rgb != [0; 3]));
        // One a voxel, but for what rounding moves over an edge.
        let cells: HashSet<[i64; 3]> = points
            .iter()
            .map(|(p, _)| [p.x, p.y, p.z].map(|metres| (metres / SPACING_M).floor() as i64))
            .collect();
        assert!(cells.len() as f64 > 0.99 * n as f64, "{} of {n}", cells.len());
    }
    // The last cloud has the whole map.
    let last = points(clouds.last().unwrap());
    let is_shown = near(last.iter().map(|(point, _)| *point));
    assert!(written.iter().all(is_shown), "map.ply has more than the last cloud");
    // Keyframes that came while there was a reader went out once each.
    let mut stamps: Vec<i64> = keyframes.iter().map(|line| line["stamp"].as_i64().unwrap()).collect();
    let n_keyframes = stamps.len();
    stamps.dedup();
    assert!(stamps.len() == n_keyframes && stamps.is_sorted(), "{stamps:?}");
}
