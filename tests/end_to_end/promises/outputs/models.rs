//! What reconstruction from images and a robot's planner read: COLMAP, nerfstudio, an occupancy grid.

use crate::common::{Run, room};
use std::path::Path;
use std::process::{Command, Output};
use tessera_sources::{FolderSource, FrameBuffers, Source, SourceOptions, SourceSpec};

fn export(run: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tessera")).arg("export").arg(run).args(arguments).output().unwrap()
}

fn exported(run: &Run, arguments: &[&str]) -> String {
    let output = export(&run.out(), arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Columns of a text file's rows, without comments and empty lines.
fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).unwrap();
    let lines = text.lines().filter(|line| !line.is_empty() && !line.starts_with('#'));
    lines.map(|line| line.split_whitespace().map(str::to_owned).collect()).collect()
}

fn numbers(row: &[String]) -> Vec<f64> {
    row.iter().filter_map(|word| word.parse().ok()).collect()
}

#[test]
fn a_colmap_model_has_the_images_and_the_poses_of_the_run() {
    let run = room().frames(20);
    assert!(run.finish().success());
    let folder = run.dir.path().join("colmap");
    let name = folder.display().to_string();
    let words = exported(&run, &["--colmap", &name, "--colmap-text", "--every", "5", "--voxel-mm", "20"]);
    assert!(words.contains("4 images") && words.contains(" points"), "{words}");
    let sparse = folder.join("sparse/0");
    let [camera] = &rows(&sparse.join("cameras.txt"))[..] else { panic!("one camera") };
    assert_eq!(camera.join(" "), "1 PINHOLE 160 120 131.25 131.25 80 60");
    let (images, trajectory) = (rows(&sparse.join("images.txt")), rows(&run.out().join("trajectory.txt")));
    assert_eq!(images.len(), 4);
    for (image, at) in images.iter().zip([0, 5, 10, 15]) {
        assert_eq!(image[9], format!("{at:06}.png"));
        assert!(folder.join("images").join(&image[9]).is_file());
        // The centre is -R^T t; the rotation is that of the inverse.
        let (placed, truth) = (numbers(&image[1..8]), numbers(&trajectory[at]));
        let [w, x, y, z, tx, ty, tz] = placed[..] else { panic!("seven numbers") };
        let back = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
            [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
            [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let centre = back.map(|row| -(row[0] * tx + row[1] * ty + row[2] * tz));
        for (found, expected) in centre.iter().zip(&truth[1..4]) {
            assert!((found - expected).abs() < 1e-6, "{image:?}: {centre:?} {truth:?}");
        }
        assert!((w.abs() - truth[7].abs()).abs() < 1e-6, "{image:?} {truth:?}");
    }
    let points = rows(&sparse.join("points3D.txt"));
    assert!(points.len() > 1000 && points.iter().all(|point| point.len() == 8));
    assert!(points.iter().any(|point| point[4..7] != points[0][4..7]), "points have colours");
    exported(&run, &["--colmap", &name, "--voxel-mm", "20"]);
    assert!(sparse.join("points3D.bin").is_file() && !sparse.join("points3D.txt").exists());
}

#[test]
fn a_dataset_of_nerfstudio_is_read_back_with_its_depth_and_its_poses() {
    let run = room().frames(12);
    assert!(run.finish().success());
    let folder = run.dir.path().join("nerf");
    exported(&run, &["--nerfstudio", &folder.display().to_string(), "--every", "3", "--voxel-mm", "20"]);
    assert!(std::fs::read(folder.join("points.ply")).unwrap().starts_with(b"ply\n"));
    let camera = Some(run.dir.path().join("camera.toml").display().to_string());
    let options = SourceOptions { camera, frames: Some(12), ..SourceOptions::default() };
    let room = tessera_sources::open(&SourceSpec::parse("room"), &options).unwrap();
    let source = FolderSource::open(&folder, None, None).unwrap();
    let (a, b) = (room.camera(), source.camera());
    assert_eq!((a.fx, a.fy, a.cx, a.cy, b.units_per_metre), (b.fx, b.fy, b.cx, b.cy, 1000.0));
    assert_eq!(source.n_frames(), Some(4));
    let trajectory = rows(&run.out().join("trajectory.txt"));
    let truth = source.ground_truth().unwrap();
    let n = (a.width * a.height) as usize;
    for at in 0..4 {
        let read = |source: &dyn Source, index: u64| {
            let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
            source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
            (depth, colour)
        };
        let ((depth, colour), (again, colour_again)) = (read(&*room, 3 * at), read(&source, at));
        assert!(colour == colour_again);
        let differs = |(raw, mm): (&u16, &u16)| {
            let metres = f64::from(*raw) / a.units_per_metre;
            *raw != 0 && *raw != u16::MAX && (metres - f64::from(*mm) / 1000.0).abs() > 5.1e-4
        };
        assert!(!depth.iter().zip(&again).any(differs), "frame {at}");
        let (found, expected) = (&truth.poses[at as usize], numbers(&trajectory[3 * at as usize]));
        for (found, expected) in found.translation.vector.iter().zip(&expected[1..4]) {
            assert!((found - expected).abs() < 1e-6, "frame {at}");
        }
        assert!((found.rotation.w.abs() - expected[7].abs()).abs() < 1e-6, "frame {at}");
    }
}

#[test]
fn the_grid_stands_on_the_floor_and_has_walls() {
    let run = room().frames(40);
    assert!(run.finish().success());
    let path = run.dir.path().join("map.yaml");
    let name = path.display().to_string();
    let words = exported(&run, &["--grid", &name]);
    let height = words.split_once("floor ").and_then(|(_, rest)| rest.split_whitespace().next());
    let height_m: f64 = height.unwrap().parse().unwrap();
    // The camera of that room goes 1.4 m above its floor.
    assert!((height_m - 1.4).abs() < 0.03, "{words}");
    let description = std::fs::read_to_string(&path).unwrap();
    assert!(description.starts_with("image: map.pgm\nmode: trinary\nresolution: 0.05\n"), "{description}");
    let grid = std::fs::read(path.with_extension("pgm")).unwrap();
    let count = |grey: u8| grid.iter().filter(|pixel| **pixel == grey).count();
    assert!(count(0) > 200 && count(254) > 500 && count(205) > 1000, "{} {}", count(0), count(254));
    exported(&run, &["--grid", &name]);
    assert!(std::fs::read(path.with_extension("pgm")).unwrap() == grid, "the same run, the same bytes");
    // Told that it is 1 m high, the camera sees a floor 0.4 m below it as nothing, and tables as floor.
    let words = exported(&run, &["--grid", &name, "--camera-height", "1.0", "--grid-cell", "0.1"]);
    assert!(words.contains("(as told)"), "{words}");
    assert!(std::fs::read(path.with_extension("pgm")).unwrap() != grid);
}

#[test]
fn what_a_run_has_no_images_for_is_told() {
    let run = room().frames(4);
    assert!(run.finish().success());
    let path = |name: &str| run.dir.path().join(name).display().to_string();
    let config = run.out().join("config.toml");
    let text = std::fs::read_to_string(&config).unwrap();
    for (source, code, expected) in [
        ("external", 3, "a camera's own program sent its frames"),
        ("/no/such/recording", 3, "/no/such/recording"),
    ] {
        std::fs::write(&config, text.replace("source = \"room\"", &format!("source = \"{source}\"")))
            .unwrap();
        let output = export(&run.out(), &["--colmap", &path("c")]);
        let words = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{words}");
        assert!(words.contains(expected), "{words}");
        assert!(!Path::new(&path("c")).exists());
    }
    let output = export(&run.out(), &["--grid", &path("map.png")]);
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));

    std::fs::write(&config, text).unwrap();
    let dataset = run.dir.path().join("nerf");
    exported(&run, &["--nerfstudio", &dataset.display().to_string()]);
    let wall = room().of(Path::new("wall")).frames(4);
    assert!(wall.finish().success());
    let colourless = room().of(&dataset).frames(1).with(&["--color-topic", "none"]);
    let camera = colourless.dir.path().join("camera.toml");
    let words = std::fs::read_to_string(&camera).unwrap();
    std::fs::write(camera, words.replace("= 5000.0", "= 1000.0")).unwrap();
    assert!(colourless.finish().success());
    for (run, arguments, expected) in [
        (&wall, ["--grid", "w.yaml"], "no floor was seen"),
        (&colourless, ["--colmap", "c"], "frames has a colour image"),
    ] {
        let file = run.dir.path().join(arguments[1]);
        let output = export(&run.out(), &[arguments[0], &file.display().to_string()]);
        let words = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(output.status.code(), Some(3), "{words}");
        assert!(words.contains(expected) && !file.exists(), "{words}");
    }
}
