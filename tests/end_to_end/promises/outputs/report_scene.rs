//! The map and the trajectory in the report: what a page holds is what the files hold.

use crate::common::{Run, room, write_scenario};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

/// The data of the page's view in 3D.
fn scene(run: &Run) -> Value {
    let page = String::from_utf8(run.output("report.html")).unwrap();
    let (_, rest) = page.split_once("<script type=\"application/json\">").expect("the page has a scene");
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

fn bytes(column: &Value) -> Vec<u8> {
    STANDARD.decode(column.as_str().unwrap()).unwrap()
}

fn floats(column: &Value) -> Vec<f64> {
    bytes(column).chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect()
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|k| value[k].as_f64().unwrap())
}

/// Positions of the map as the page draws them.
fn points(scene: &Value) -> Vec<[f64; 3]> {
    let (low, size) = (numbers::<3>(&scene["low"]), numbers::<3>(&scene["size"]));
    let steps: Vec<u16> = bytes(&scene["points"]["position"])
        .chunks_exact(2)
        .map(|b| u16::from_le_bytes(b.try_into().unwrap()))
        .collect();
    let place = |p: &[u16]| std::array::from_fn(|k| low[k] + size[k] * f64::from(p[k]) / 65_535.0);
    steps.chunks_exact(3).map(place).collect()
}

/// Positions of `map.ply` in the axes of the page.
fn map(run: &Run, page_from_world: &Value) -> Vec<[f64; 3]> {
    let ply = run.output("map.ply");
    let end = ply.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let rows: [[f64; 4]; 3] = std::array::from_fn(|row| numbers(&page_from_world[row]));
    let coordinate = |b: &[u8]| f64::from(f32::from_le_bytes(b.try_into().unwrap()));
    ply[end..]
        .chunks_exact(27)
        .map(|point| {
            let [x, y, z] = [0, 4, 8].map(|at| coordinate(&point[at..at + 4]));
            rows.map(|row| row[0] * x + row[1] * y + row[2] * z + row[3])
        })
        .collect()
}

fn extents(points: &[[f64; 3]]) -> [(f64, f64); 3] {
    std::array::from_fn(|axis| {
        let values = points.iter().map(|point| point[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    })
}

fn n_rows(run: &Run, name: &str) -> usize {
    let text = String::from_utf8(run.output(name)).unwrap();
    text.lines().filter(|line| !line.starts_with('#')).count()
}

#[test]
fn the_page_has_the_map_the_poses_and_the_loops_of_the_run() {
    // Fine voxels, so that the map has more points than a page.
    let run = room().frames(120).with(&["--set", "output.map_voxel_m=0.003"]);
    let run = run.with(&["--set", "mapping.loop.min_frames=20"]);
    assert!(run.finish().success());
    let scene = scene(&run);
    let (shown, whole) = (points(&scene), map(&run, &scene["parts"][0]["page_from_world"]));
    assert!(whole.len() > 60_000, "{} points in the map: nothing is thinned", whole.len());
    assert!((10_000..=60_000).contains(&shown.len()), "{}", shown.len());
    assert_eq!(scene["parts"].as_array().unwrap().len(), 1);
    assert_eq!(scene["parts"][0]["n_points"], shown.len());
    assert_eq!(bytes(&scene["points"]["rgb"]).len(), 3 * shown.len());
    assert_eq!(bytes(&scene["points"]["normal"]).len(), 2 * shown.len());

    // The mean of a voxel lies within it, so no side moves by more than an edge along each axis.
    let reach = 3f64.sqrt() * scene["voxel_m"].as_f64().unwrap();
    for (axis, (page, file)) in extents(&shown).into_iter().zip(extents(&whole)).enumerate() {
        assert!(page.0 > file.0 - 1e-3 && page.0 < file.0 + reach, "axis {axis}: {page:?}, {file:?}");
        assert!(page.1 < file.1 + 1e-3 && page.1 > file.1 - reach, "axis {axis}: {page:?}, {file:?}");
    }
    let keyframes = bytes(&scene["points"]["keyframe"]);
    let of_points = keyframes.chunks_exact(2).map(|b| usize::from(u16::from_le_bytes([b[0], b[1]])));
    let n_keyframes = n_rows(&run, "keyframes.txt");
    assert!(n_keyframes > 2);
    assert_eq!(floats(&scene["keyframes"]["position"]).len(), 3 * n_keyframes);
    assert!(of_points.max().unwrap() < n_keyframes);

    let poses = floats(&scene["frames"]["position"]);
    assert_eq!(poses.len(), 3 * n_rows(&run, "trajectory.txt"));
    assert_eq!(poses.len(), 3 * 120);
    let summary: Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    let verdicts = bytes(&scene["loops"]["verdict"]);
    assert_eq!(verdicts.len() as u64, summary["loops_found"].as_u64().unwrap());
    assert!(!verdicts.is_empty(), "the loops are those of the summary");
    assert_eq!(bytes(&scene["loops"]["ends"]).len(), 24 * verdicts.len());
}

#[test]
fn submaps_that_are_apart_stand_beside_the_main_map_by_name() {
    let run = room().with(&["--set", "mapping.submaps.after_s=0.3"]);
    let mut frames: Vec<Option<u64>> = (0..40).map(Some).collect();
    frames.extend([None; 3]);
    frames.extend((110..140).map(Some));
    let folder = run.dir.path().join("recording");
    write_scenario(&folder, &run.dir.path().join("camera.toml"), &frames);
    let run = run.frames(frames.len() as u64).of(&folder);
    assert!(run.finish().success());
    let scene = scene(&run);
    let names: Vec<&str> =
        scene["parts"].as_array().unwrap().iter().map(|part| part["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["main map", "submap 1, apart"]);
    let (shown, n_main) = (points(&scene), scene["parts"][0]["n_points"].as_u64().unwrap() as usize);
    let (main, apart) = shown.split_at(n_main);
    assert!(main.len() > 1000 && apart.len() > 1000, "{}, {}", main.len(), apart.len());
    assert!(extents(apart)[0].0 > extents(main)[0].1 + 0.4, "they do not lie in each other");
    let parts = bytes(&scene["frames"]["part"]);
    assert_eq!(parts.iter().filter(|part| **part == 0).count(), n_rows(&run, "trajectory.txt"));
    assert_eq!(parts.iter().filter(|part| **part == 1).count(), n_rows(&run, "trajectory_submap_1.txt"));
}

#[test]
fn a_run_without_its_surfaces_says_that_there_is_no_map() {
    let run = room().frames(6);
    assert!(run.finish().success());
    std::fs::remove_file(run.out().join("keyframes.store")).unwrap();
    let status = std::process::Command::new(env!("CARGO_BIN_EXE_tessera"))
        .arg("report")
        .arg(run.out())
        .status()
        .unwrap();
    assert!(status.success());
    let page = String::from_utf8(run.output("report.html")).unwrap();
    assert!(page.contains("No map: ") && page.contains("keyframes.store"), "the reason is told");
    let scene = scene(&run);
    assert_eq!((points(&scene).len(), floats(&scene["frames"]["position"]).len()), (0, 18));
}
