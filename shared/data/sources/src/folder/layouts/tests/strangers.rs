//! Folders as other systems, file managers and loggers leave them.

use super::misread::named;
use super::*;

fn warned(source: &FolderSource) -> String {
    source.warnings().join("\n")
}

#[test]
fn hidden_files_beside_the_images_are_no_images() {
    let folder = named("color", |k, _| format!("{k:05}"));
    for name in ["depth/._00003.png", "color/._00003.jpg", "._camera.toml", "depth/.DS_Store"] {
        folder.write(name, b"\0\x05\x16\x07");
    }
    let source = folder.open();
    assert_eq!((source.n_frames(), source.pairing().n_pairs, source.warnings().len()), (Some(60), 60, 0));
}

#[test]
fn folders_and_lists_are_found_in_capitals_and_with_a_word_before() {
    for (depth, colour) in [("Depth", "RGB"), ("aligned_depth", "rgb_left"), ("depth_png", "aligned_color")] {
        let folder = Folder::new();
        for k in 0..5 {
            folder.depth(&format!("{depth}/{k}.png"), 1500 + k);
            folder.colour(&format!("{colour}/{k}.jpg"), SIZE, 90);
        }
        folder.write("Camera.TOML", CAMERA);
        let source = folder.open();
        assert_eq!((source.pairing().n_depth, source.pairing().n_pairs), (5, 5), "{depth} {colour}");
        assert_eq!(read(&source, 3).0, 1503);
        // Which of two is meant nothing says.
        if depth != "Depth" {
            folder.depth("other_depth/0.png", 7);
            assert!(folder.refusal().contains("no layout that is known"), "{}", folder.refusal());
        }
    }
    let folder = Folder::new();
    folder.depth("depth/0.png", 1500);
    folder.depth("depth/1.png", 1501);
    folder.write("Depth.txt", "1700000000.5 depth/0.png\n1700000000.6 depth/1.png\n");
    folder.write("GroundTruth.txt", "1700000000.5 0 0 0 0 0 0 1\n1700000000.6 1 0 0 0 0 0 1\n");
    folder.write("camera.toml", CAMERA);
    let source = folder.open();
    assert_eq!(stamps(&source), [1_700_000_000_500_000_000, 1_700_000_000_600_000_000]);
    assert_eq!(source.ground_truth().unwrap().len(), 2);
}

#[test]
fn milliseconds_with_a_fraction_are_times() {
    // As rs-convert of librealsense names its images.
    let folder = named("color", |_, t| format!("x_Depth_{}.{:011}", t / 1_000_000, t % 1_000_000 * 100_000));
    let source = folder.open();
    assert_eq!(stamps(&source)[1] - stamps(&source)[0], 33_333_333);
    assert!(described(&source, "times").starts_with("milliseconds"), "{}", described(&source, "times"));
}

#[test]
fn images_of_two_cameras_in_one_folder_are_refused() {
    type Name = fn(i64) -> String;
    let table: [Name; 3] = [
        |k| format!("cam{}_{:05}", k % 2, k / 2),
        |k| format!("{:05}_{}", k / 2, k % 2),
        |k| format!("{:04}-{}-depth", k / 3, 1 + k % 3),
    ];
    for name in table {
        let refusal = named("color", |k, _| name(k)).refusal();
        assert!(refusal.contains("images of several cameras or takes?"), "{}: {refusal}", name(7));
        assert!(refusal.contains("a depth.txt with lines of: timestamp filename"), "{refusal}");
    }
}

#[test]
fn names_without_a_meaning_get_the_file_that_gives_one() {
    let refusal = named("color", |k, _| format!("{:x}", 0xabc_def0 + k * 33_333)).refusal();
    assert!(refusal.contains("several forms") && refusal.contains("a depth.txt with lines"), "{refusal}");
}

#[test]
fn a_file_of_times_that_is_not_read_is_named() {
    let folder = named("color", |k, _| format!("{k:05}"));
    folder.write("timestamps.txt", "0.0\n0.066\n");
    let words = warned(&folder.open());
    assert!(words.contains("timestamps.txt is not read") && words.contains("--fps N"), "{words}");
    let timed = named("color", |_, t| t.to_string());
    timed.write("timestamps.txt", "0.0\n0.066\n");
    assert_eq!(warned(&timed.open()), "");
}

#[test]
fn images_side_by_side_and_folders_further_down_get_their_command() {
    let folder = Folder::new();
    for k in 0..3 {
        folder.depth(&format!("{k}_Depth.png"), 1500);
        folder.colour(&format!("{k}_color.jpg"), SIZE, 90);
    }
    let refusal = folder.refusal();
    assert!(refusal.contains("ls -v *Depth*.png | awk") && refusal.contains("> depth.txt"), "{refusal}");
    assert!(refusal.contains("ls -v *color*.jpg | awk") && refusal.contains("> rgb.txt"), "{refusal}");
    let deep = Folder::new();
    deep.depth("a/b/depth/0.png", 1500);
    let expected = format!("did you mean {}?", deep.path().join("a/b").display());
    assert!(deep.refusal().contains(&expected), "{}", deep.refusal());
}

#[test]
fn camera_files_that_are_not_understood_or_mirror_the_map_are_named() {
    let folder = named("color", |k, _| format!("{k:05}"));
    fs::remove_file(folder.path().join("camera.toml")).unwrap();
    folder.write("calibration.json", r#"{"CalibrationInformation": {"Cameras": []}}"#);
    let refusal = folder.refusal();
    assert!(refusal.contains("no camera of a known form in calibration.json"), "{refusal}");
    let json = |fy: f64| {
        format!(
            r#"{{"width": 32, "height": 24, "fx": 30, "fy": {fy}, "cx": 15.5, "cy": 11.5, "depth_scale": 1000}}"#
        )
    };
    // As PowerShell writes it.
    let wide: Vec<u8> = json(30.0).encode_utf16().flat_map(u16::to_le_bytes).collect();
    folder.write("intrinsic.json", [b"\xff\xfe", wide.as_slice()].concat());
    assert_eq!((folder.open().camera().fy, folder.open().doubts()), (30.0, &[] as &[String]));
    folder.write("intrinsic.json", json(-30.0));
    let doubts = folder.open().doubts().join("\n");
    assert!(doubts.contains("the map is mirrored"), "{doubts}");
}

#[test]
fn ground_truth_of_other_times_is_stated() {
    let folder = named("color", |k, _| format!("{k:05}"));
    for (file, stem) in [("depth.txt", "depth"), ("rgb.txt", "color")] {
        let end = if stem == "depth" { "png" } else { "jpg" };
        let row = |k: u32| format!("{} {stem}/{k:05}.{end}\n", 1_700_000_000 + k);
        folder.write(file, (0..5).map(row).collect::<String>());
    }
    let truth = |shift: i64, unit: i64| {
        let row = |k: i64| format!("{} {k} 0 0 0 0 0 1\n", (1_700_000_000 + shift + k) * unit);
        folder.write("groundtruth.txt", (0..5).map(row).collect::<String>());
        warned(&folder.open())
    };
    let unread = "depth.txt lists 5 of the 60 images in depth/";
    for unit in [1, 1000, 1_000_000, 1_000_000_000] {
        assert_eq!(truth(0, unit), unread);
    }
    let words = truth(-25_200, 1);
    assert!(words.contains("nothing is compared; do their clocks differ?"), "{words}");
    // EuRoC's rows under that name.
    folder.write("groundtruth.txt", "1700000000000000000,1,2,3,1,0,0,0\n1700000001000000000,1,2,3,1,0,0,0\n");
    let source = folder.open();
    assert_eq!(source.ground_truth().unwrap().poses[0].rotation.angle(), 0.0);
}

#[test]
fn a_camera_in_the_folder_above_is_that_of_its_sequences_and_else_named() {
    let scene = Folder::new();
    for k in 0..2 {
        scene.depth_of(&format!("seq-01/frame-{k:06}.depth.png"), (640, 480), 1500);
        scene.depth_of(&format!("kitchen/depth/{k}.png"), (640, 480), 1500);
    }
    let open = |name: &str| FolderSource::open(&scene.path().join(name), None, None);
    let source = open("seq-01").unwrap();
    assert_eq!(source.camera().fx, 585.0);
    assert!(warned(&source).contains("the camera is assumed to be that of 7-Scenes"), "{}", warned(&source));
    // As 3DMatch has it.
    scene.write("camera-intrinsics.txt", "615 0 321\n0 616 244\n0 0 1\n");
    let source = open("seq-01").unwrap();
    assert_eq!(source.camera().fx, 615.0);
    assert!(described(&source, "camera").contains("../camera-intrinsics.txt"), "{:?}", source.description());
    let refusal = open("kitchen").unwrap_err().to_string();
    assert!(refusal.contains("one in the folder above that fits (--camera '"), "{refusal}");
    assert!(refusal.contains("kitchen/../camera-intrinsics.txt')"), "{refusal}");
    scene.write("camera.toml", CAMERA);
    assert!(!open("kitchen").unwrap_err().to_string().contains("that fits"));
}

#[test]
fn pairs_without_times_get_the_command_that_numbers_them() {
    let folder = Folder::new();
    folder.write("associations.txt", "depth/1.png rgb/1.png\n");
    let refusal = folder.refusal();
    assert!(
        refusal.contains("expected: number depth/FILE number rgb/FILE; pairs without times"),
        "{refusal}"
    );
    assert!(refusal.contains("awk '{print NR, $1, NR, $2}' associations.txt"), "{refusal}");
}

#[test]
fn cameras_of_single_frames_are_one_by_their_median() {
    let folder = Folder::new();
    let write = |focal: [f64; 3], more: &str| {
        let mut frames = Vec::new();
        for (k, focal) in focal.iter().enumerate() {
            folder.depth(&format!("depth/{k}.png"), 1500);
            frames.push(format!(
                r#"{{"depth_file_path": "depth/{k}.png", "fl_x": {focal}, "fl_y": 62.0, "cx": 32.0, "cy": 24.0, "w": 64, "h": 48{more}}}"#
            ));
        }
        let frames = frames.join(", ");
        folder.write(
            "transforms.json",
            format!(r#"{{"camera_model": "OPENCV", "integer_depth_scale": 0.0005, "frames": [{frames}]}}"#),
        );
    };
    write([60.0, 60.2, 60.1], "");
    let source = folder.open();
    let camera = source.camera();
    assert!((camera.fx - 30.05).abs() < 1e-9 && (camera.cx - 15.5).abs() < 1e-9, "{camera:?}");
    assert_eq!(camera.units_per_metre, 2000.0);
    assert!(!warned(&source).contains("focal length"), "{}", warned(&source));
    write([60.0, 70.0, 65.0], "");
    assert!(warned(&folder.open()).contains("the focal length changes by"), "{}", warned(&folder.open()));
    write([60.0; 3], r#", "k1": 0.1"#);
    assert!(folder.refusal().contains("nor for each of one size without distortion"), "{}", folder.refusal());
}
