//! Folders that were once read without a word and wrong.

use super::*;
use tessera_frames::ImageError;

const START: i64 = 1_700_000_000_000_000_000;

/// Sixty images at 30 frames a second in `depth/` and a folder of colour, named by number and time.
pub(super) fn named(colour: &str, name: impl Fn(i64, i64) -> String) -> Folder {
    let folder = Folder::new();
    let depth = Folder::new();
    depth.depth("d.png", 1500);
    depth.colour("c.jpg", SIZE, 90);
    let [depth_png, colour_jpg] = ["d.png", "c.jpg"].map(|file| fs::read(depth.path().join(file)).unwrap());
    for k in 0..60 {
        let name = name(k, START + (k * 1_000_000_000 + 15) / 30);
        folder.write(&format!("depth/{name}.png"), &depth_png);
        folder.write(&format!("{colour}/{name}.jpg"), &colour_jpg);
    }
    folder.write("camera.toml", CAMERA);
    folder
}

#[test]
fn images_that_are_named_by_their_time_have_it() {
    type Name = fn(i64, i64) -> String;
    let table: [(Name, i64, i64); 8] = [
        (|_, t| format!("{}.{:06}", t / 1_000_000_000, t % 1_000_000_000 / 1000), START, 1000),
        (|_, t| format!("{}_{:09}", t / 1_000_000_000, t % 1_000_000_000), START, 0),
        (|_, t| t.to_string(), START, 0),
        (|_, t| (t / 1000).to_string(), START, 1000),
        (|_, t| (t / 1_000_000).to_string(), START, 1_000_000),
        (|k, _| format!("{k:06}_cam0"), 0, 1),
        (|k, t| format!("{k:07}-{:012}", (t - START) / 1000), 0, 1000),
        (|_, t| format!("frame_{}", (t - START) / 1_000_000), 0, 1_000_000),
    ];
    for (name, first, within) in table {
        let folder = named("color", name);
        let source = folder.open();
        let stamps = stamps(&source);
        assert_eq!((stamps.len(), source.pairing().n_pairs), (60, 60), "{}", name(7, START));
        for (k, stamp) in (0..).zip(&stamps) {
            let expected = first + (k * 1_000_000_000 + 15) / 30;
            assert!((stamp - expected).abs() <= within, "{}: {stamp}", name(k, expected));
        }
        assert_eq!(source.warnings(), &[] as &[String]);
        // At a rate that is given they are frames.
        let slow = SourceOptions { fps: Some(10.0), ..SourceOptions::default() };
        let source = FolderSource::open_with(folder.path(), &slow).unwrap();
        if within != 1_000_000 || first == START {
            assert_eq!(super::stamps(&source)[59], 5_900_000_000, "{}", name(7, START));
        }
        assert_eq!(source.pairing().n_pairs, 60);
    }
}

#[test]
fn depth_and_colour_that_were_not_taken_at_once_are_paired_by_their_names_times() {
    let folder = Folder::new();
    for k in 0..5_i64 {
        let t = START / 1000 + k * 33_333;
        folder.depth(&format!("depth/{}.{:06}.png", t / 1_000_000, t % 1_000_000), 1500);
        let t = t + 7000;
        folder.colour(&format!("rgb/{}.{:06}.png", t / 1_000_000, t % 1_000_000), SIZE, 90);
    }
    folder.write("camera.toml", CAMERA);
    let source = folder.open();
    assert_eq!((source.pairing().n_pairs, source.pairing().largest_difference_nanos), (5, 7_000_000));
}

#[test]
fn names_without_a_meaning_are_refused() {
    let folder = Folder::new();
    for number in [0, 13, 55, 80, 140, 171, 230] {
        folder.depth(&format!("depth/{number}.png"), 1500);
    }
    folder.write("camera.toml", CAMERA);
    let message = folder.refusal();
    assert!(message.contains("which may be frames or times; --fps N"), "{message}");
    let at_a_rate = SourceOptions { fps: Some(10.0), ..SourceOptions::default() };
    assert_eq!(stamps(&FolderSource::open_with(folder.path(), &at_a_rate).unwrap())[1], 1_300_000_000);
    let scannet = Folder::new();
    for number in [START, START + 33_333_333] {
        scannet.depth(&format!("depth/{number}.png"), 1500);
    }
    scannet.write("intrinsic/intrinsic_depth.txt", "30 0 15.5 0\n0 30 11.5 0\n0 0 1 0\n0 0 0 1\n");
    assert_eq!(stamps(&scannet.open()), [START, START + 33_333_333]);
}

const INTRINSIC: &str =
    r#""width": 32, "height": 24, "intrinsic_matrix": [30.0, 0, 0, 0, 31.0, 0, 15.5, 11.5, 1]"#;

#[test]
fn the_depth_scale_and_rate_of_open3d_are_used() {
    let folder = named("color", |k, _| format!("{k:05}"));
    fs::remove_file(folder.path().join("camera.toml")).unwrap();
    folder.write(
        "intrinsic.json",
        format!(r#"{{{INTRINSIC}, "depth_scale": 4000.0, "fps": 15.0, "device_name": "L515"}}"#),
    );
    let source = folder.open();
    assert_eq!(source.camera().units_per_metre, 4000.0);
    assert_eq!(stamps(&source)[59], 3_933_333_333);
    assert!(described(&source, "times").contains("15 frames a second, as the camera file states"));
    // Metres a unit, as librealsense has them, and in a file of its own.
    folder.write("intrinsic.json", format!("{{{INTRINSIC}}}"));
    folder.write("config.json", r#"{"depth_factor": 0.00025, "name": "x"}"#);
    assert_eq!(folder.open().camera().units_per_metre, 4000.0);
    fs::remove_file(folder.path().join("config.json")).unwrap();
    assert_eq!(folder.open().camera().units_per_metre, 1000.0);
    folder.write("intrinsic.json", format!(r#"{{{INTRINSIC}, "depth_scale": 0}}"#));
    assert!(folder.refusal().contains("the depth scale is 0"), "{}", folder.refusal());
}

#[test]
fn of_two_camera_files_the_one_that_fits_the_images_is_taken() {
    let folder = named("color", |k, _| format!("{k:05}"));
    fs::remove_file(folder.path().join("camera.toml")).unwrap();
    folder.write(
        "color_intrinsics.json",
        r#"{"width": 64, "height": 36, "intrinsic_matrix": [45, 0, 0, 0, 45, 0, 32, 18, 1]}"#,
    );
    assert!(
        folder.refusal().contains("color_intrinsics.json: the camera is 64x36 px, the depth images 32x24")
    );
    folder.write("depth_intrinsics.json", format!("{{{INTRINSIC}}}"));
    assert_eq!(folder.open().camera().fy, 31.0);
    // Two of the size of depth: the one that is named so; else none.
    folder.write("color_intrinsics.json", format!("{{{}}}", INTRINSIC.replace("30.0", "40.0")));
    assert_eq!(folder.open().camera().fx, 30.0);
    fs::rename(folder.path().join("depth_intrinsics.json"), folder.path().join("other.json")).unwrap();
    assert!(folder.refusal().contains("several camera files that differ: color_intrinsics.json, other.json"));
}

#[test]
fn associations_by_number_say_nothing_of_the_camera() {
    let folder = Folder::new();
    let mut list = String::new();
    for k in 1..=3 {
        folder.depth_of(&format!("depth/{k}.png"), (640, 480), 5000);
        list.push_str(&format!("{k} depth/{k}.png {k} rgb/{k}.jpg\n"));
    }
    folder.write("associations.txt", &list);
    let message = folder.refusal();
    assert!(
        message.contains("has no camera.toml") && message.contains("width = 640, height = 480"),
        "{message}"
    );
    assert!(message.contains("--camera guess"), "{message}");
    let guess = SourceOptions { camera: Some("guess".into()), ..SourceOptions::default() };
    let source = FolderSource::open_with(folder.path(), &guess).unwrap();
    assert!(source.camera().fy > 0.0);
    assert!(
        source.doubts()[0].contains("a guess by the size of the images: a Kinect"),
        "{:?}",
        source.doubts()
    );
    assert_eq!(stamps(&source), [33_333_333, 66_666_667, 100_000_000]);
    // The same in the lists of TUM.
    fs::remove_file(folder.path().join("associations.txt")).unwrap();
    folder.write("depth.txt", "1 depth/1.png\n2 depth/2.png\n3 depth/3.png\n");
    assert!(folder.refusal().contains("has no camera.toml"));
    let source = FolderSource::open_with(folder.path(), &guess).unwrap();
    assert_eq!(stamps(&source), [33_333_333, 66_666_667, 100_000_000]);
    assert!(
        source.warnings().join("\n").contains("the stamps of depth.txt are frame numbers"),
        "{:?}",
        source.warnings()
    );
    // What says so may be the name of the folder.
    let named = folder.path().join("living_room_traj2_frei_png");
    fs::create_dir(&named).unwrap();
    fs::write(named.join("associations.txt"), list).unwrap();
    let source = FolderSource::open(&named, None, None).unwrap();
    assert!(source.camera().fy < 0.0 && source.warnings()[0].contains("the camera is assumed to be icl"));
}

#[test]
fn the_camera_beside_images_named_as_those_of_7_scenes_is_used() {
    let folder = Folder::new();
    for k in 0..2 {
        folder.depth_of(&format!("frame-{k:06}.depth.png"), (640, 480), 1500);
    }
    assert!(folder.refusal().contains("--camera FILE or --camera freiburg1|freiburg2|freiburg3|icl|7scenes"));
    let files = [
        (
            "info.txt",
            "m_depthWidth = 640\nm_depthHeight = 480\nm_depthShift = 2000\nm_calibrationDepthIntrinsic = 615 0 321 0 0 616 244 0 0 0 1 0 0 0 0 1\n",
            2000.0,
        ),
        ("camera-intrinsics.txt", "615 0 321\n0 616 244\n0 0 1\n", 1000.0),
        (
            "calibration.yaml",
            "image_width: 640\nimage_height: 480\ncamera_matrix:\n  data: [615, 0, 321, 0, 616, 244, 0, 0, 1]\n",
            1000.0,
        ),
        ("cameras.txt", "1 PINHOLE 640 480 615 616 321.5 244.5\n", 1000.0),
        ("intrinsics.json", r#"{"fx": 615, "fy": 616, "cx": 321, "cy": 244}"#, 1000.0),
    ];
    for (file, text, units) in files {
        folder.write(file, text);
        let source = folder.open();
        let camera = source.camera();
        assert_eq!((camera.fx, camera.fy, camera.cx, camera.cy), (615.0, 616.0, 321.0, 244.0), "{file}");
        assert_eq!(camera.units_per_metre, units, "{file}");
        let assumed =
            source.warnings().join("\n").contains("states no depth units: 1000 a metre are assumed");
        assert_eq!(assumed, file != "info.txt", "{file}: {:?}", source.warnings());
        fs::remove_file(folder.path().join(file)).unwrap();
    }
}

#[test]
fn colour_without_a_partner_is_stated() {
    let folder = named("images", |k, _| k.to_string());
    assert_eq!(folder.open().pairing().n_pairs, 60);
    fs::rename(folder.path().join("images"), folder.path().join("left_eye")).unwrap();
    let source = folder.open();
    assert!(
        source.warnings()[0].contains("no frame has colour: there is none of the folders color"),
        "{:?}",
        source.warnings()
    );
    // A clock that is five seconds off.
    let folder = Folder::new();
    let (mut depth, mut rgb) = (String::new(), String::new());
    for k in 0..4 {
        folder.depth(&format!("{k}.png"), 1500);
        folder.colour(&format!("{k}.jpg"), SIZE, 90);
        depth.push_str(&format!("{:.3} {k}.png\n", f64::from(k) * 0.033));
        rgb.push_str(&format!("{:.3} {k}.jpg\n", f64::from(k) * 0.033 + 5.0));
    }
    folder.write("depth.txt", depth);
    folder.write("rgb.txt", rgb);
    folder.write("camera.toml", CAMERA);
    let warning = folder.open().warnings().join("\n");
    assert!(
        warning.contains("no frame has colour: the colour image nearest")
            && warning.contains("5.000 s later"),
        "{warning}"
    );
}

#[test]
fn stamps_of_a_list_that_go_back_repeat_or_are_not_set_lose_no_image() {
    let open = |list: &[&str]| {
        let folder = Folder::new();
        let mut text = String::new();
        for (k, stamp) in list.iter().enumerate() {
            folder.depth(&format!("{k}.png"), 1000 + k as u16);
            text.push_str(&format!("{stamp} {k}.png\n"));
        }
        folder.write("depth.txt", text);
        folder.write("camera.toml", CAMERA);
        (folder.open(), folder)
    };
    let (source, _folder) = open(&["5.00", "5.03", "5.06", "5.00", "5.03", "5.06"]);
    assert_eq!(stamps(&source), [500, 503, 506, 509, 512, 515].map(|s| s * 10_000_000));
    assert_eq!((read(&source, 2).0, read(&source, 3).0), (1002, 1003), "in the order of the list");
    assert!(
        source.warnings()[0].contains("the stamps go back by 0.060 s at image 4"),
        "{:?}",
        source.warnings()
    );
    let (source, _folder) = open(&["0", "0", "0", "0"]);
    assert_eq!((stamps(&source).len(), stamps(&source)[1]), (4, 33_333_333));
    assert!(
        source.warnings()[0].contains("4 of 4 stamps are not set: 30 frames a second are assumed"),
        "{:?}",
        source.warnings()
    );
    let shuffled: Vec<String> = (0..40).map(|k| format!("{:.3}", f64::from(k * 17 % 40) * 0.033)).collect();
    let (source, _folder) = open(&shuffled.iter().map(String::as_str).collect::<Vec<&str>>());
    assert_eq!((stamps(&source).len(), read(&source, 1).0), (40, 1033), "17 * 33 = 1 modulo 40");
}

#[test]
fn colour_that_is_not_there_or_not_read_leaves_depth() {
    let folder = named("color", |k, _| k.to_string());
    for k in 20..26 {
        fs::remove_file(folder.path().join(format!("color/{k}.jpg"))).unwrap();
    }
    let list: String = (0..60).map(|k| format!("{:.3} color/{k}.jpg\n", f64::from(k) * 0.033)).collect();
    folder.write("depth.txt", list.replace("color", "depth").replace("jpg", "png"));
    folder.write("rgb.txt", list);
    let source = folder.open();
    assert_eq!((source.n_frames(), source.pairing().n_pairs), (Some(60), 54));
    assert!(source.warnings()[0].contains("6 of 60 colour images are not there, the first: color/20.jpg"));
    assert!(!read(&source, 21).1 && read(&source, 27).1);
    fs::remove_dir_all(folder.path().join("color")).unwrap();
    let source = folder.open();
    assert!(source.warnings().join("\n").contains("no frame has colour"), "{:?}", source.warnings());
    assert_eq!(read(&source, 3), (1500, false, 0));
    for k in 0..60 {
        folder.write(&format!("color/{k}.jpg"), "RIFF....AVI LIST");
    }
    let source = folder.open();
    assert!(
        source.warnings()[0]
            .contains("no frame has colour: color/0.jpg: found a file that begins with 'RIFF"),
        "{:?}",
        source.warnings()
    );
    assert_eq!(read(&source, 3), (1500, false, 0));
    // One that breaks later costs itself alone.
    let folder = named("color", |k, _| k.to_string());
    folder.write("color/7.jpg", [0xff, 0xd8]);
    let source = folder.open();
    let (mut depth, mut colour) = (vec![9; 768], vec![9; 3 * 768]);
    let (info, error) =
        source.read_what_is_there(7, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
    assert!(depth[0] == 1500 && !info.has_colour);
    assert!(
        matches!(error, Some(SourceError::Colour(inner)) if matches!(*inner, SourceError::Image { source: ImageError::Damaged { .. }, .. }))
    );
}

#[test]
fn confidence_that_is_missing_in_part_costs_no_frame() {
    let folder = Folder::new();
    for k in 0..3 {
        folder.depth(&format!("depth/{k:06}.png"), 1800);
    }
    let mut png = Vec::new();
    PngEncoder::new(&mut png).write_image(&[0; 768], SIZE.0, SIZE.1, ExtendedColorType::L8).unwrap();
    folder.write("confidence/000001.png", png);
    folder.write("camera_matrix.csv", "1440.0, 0.0, 960.0\n0.0, 1440.0, 720.0\n0.0, 0.0, 1.0\n");
    let rows: String =
        (0..3).map(|k| format!("{}, {k:06}, 0, 0, 0, 0, 0, 0, 1\n", f64::from(k) * 0.1)).collect();
    folder.write("odometry.csv", format!("timestamp, frame, x, y, z, qx, qy, qz, qw\n{rows}"));
    let source = folder.open();
    assert_eq!([0, 1, 2].map(|k| read(&source, k).0), [1800, 0, 1800]);
    assert!(
        source.warnings().join("\n").contains("2 of 3 confidence images are not there"),
        "{:?}",
        source.warnings()
    );
}

#[test]
fn eth3d_has_its_camera_in_calibration_txt() {
    let folder = Folder::new();
    folder.depth("depth/0.5.png", 5000);
    folder.write("depth.txt", "0.5 depth/0.5.png\n");
    folder.write("associated.txt", "0.5 rgb/0.5.png 0.5 depth/0.5.png\n");
    folder.write("calibration.txt", "30.5 31.5 15.5 11.5\n");
    let source = folder.open();
    let camera = source.camera();
    assert_eq!((camera.fx, camera.fy, camera.units_per_metre), (30.5, 31.5, 5000.0));
    assert!(source.warnings()[0].contains("calibration.txt states no depth units: 5000 a metre are assumed"));
}

#[test]
fn transforms_of_nerfstudio_have_camera_times_and_poses() {
    let folder = Folder::new();
    let mut frames = Vec::new();
    for k in 0..3 {
        folder.depth(&format!("depth/{k}.png"), 13_107);
        folder.colour(&format!("images/{k}.jpg"), (64, 48), 90);
        // Half a turn about x is no rotation of our camera.
        let matrix = format!("[[1, 0, 0, {k}], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]");
        frames.push(format!(
            r#"{{"file_path": "images/{k}.jpg", "depth_file_path": "depth/{k}.png", "transform_matrix": {matrix}, "timestamp": 7.{k}}}"#
        ));
    }
    frames.reverse();
    let camera = r#""fl_x": 60, "fl_y": 62, "cx": 32, "cy": 24, "w": 64, "h": 48, "integer_depth_scale": 0.000152590218966964"#;
    folder.write("transforms.json", format!("{{{camera}, \"frames\": [{}]}}", frames.join(", ")));
    let source = folder.open();
    assert!(described(&source, "layout").starts_with("nerfstudio"), "{}", described(&source, "layout"));
    let camera = source.camera();
    assert_eq!((camera.fx, camera.fy, camera.cx, camera.cy), (30.0, 31.0, 15.5, 11.5));
    assert!((camera.units_per_metre - 6553.5).abs() < 1e-6, "{}", camera.units_per_metre);
    assert_eq!(stamps(&source), [7_000_000_000, 7_100_000_000, 7_200_000_000]);
    let truth = source.ground_truth().unwrap();
    assert!(truth.poses[2].rotation.angle() < 1e-9 && truth.poses[2].translation.x == 2.0);
    assert!(source.warnings().is_empty() && read(&source, 1).1, "{:?}", source.warnings());
    // Without stamps by the numbers in the names.
    let text = fs::read_to_string(folder.path().join("transforms.json")).unwrap();
    folder.write("transforms.json", text.replace("timestamp", "other"));
    assert_eq!(stamps(&folder.open()), [0, 33_333_333, 66_666_667]);
    folder.write("transforms.json", text.replace("depth/1.png", "../1.png"));
    assert!(folder.refusal().contains("a frame's file is '../1.png', expected a path inside the folder"));
    folder.write("transforms.json", text.replace("\"h\": 48", "\"h\": 60"));
    assert!(folder.refusal().contains("not of one shape"), "{}", folder.refusal());
}
