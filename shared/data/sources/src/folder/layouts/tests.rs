//! Folders laid out as the documentation of each product says, and what is read of them.

use crate::{FolderSource, FrameBuffers, Source, SourceError, SourceOptions};
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder, codecs::png::PngEncoder};
use std::fs;
use std::path::Path;

mod images;
mod misread;
mod mutations;
mod polycam;
mod read_wrong;
mod record3d;
mod strangers;

const SIZE: (u32, u32) = (32, 24);
/// Camera to world: a step of 0.25 m to the right and a half turn about y.
const TURNED: &str = "-1 0 0 0.25\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n";
const IDENTITY: &str = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
const CAMERA: &str =
    "width = 32\nheight = 24\nfx = 30.0\nfy = 30.0\ncx = 15.5\ncy = 11.5\nunits_per_metre = 1000.0\n";

/// A folder that makes the folders of its files.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    fn path(&self) -> &Path {
        self.0.path()
    }

    fn write(&self, file: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path().join(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }

    /// A depth image of one raw value.
    fn depth(&self, file: &str, raw: u16) {
        self.depth_of(file, SIZE, raw);
    }

    fn depth_of(&self, file: &str, size: (u32, u32), raw: u16) {
        let values = vec![raw; (size.0 * size.1) as usize];
        let mut png = Vec::new();
        let encoder = PngEncoder::new(&mut png);
        encoder.write_image(bytemuck::cast_slice(&values), size.0, size.1, ExtendedColorType::L16).unwrap();
        self.write(file, png);
    }

    /// A colour image of one brightness, PNG or JPEG by its name.
    fn colour(&self, file: &str, size: (u32, u32), value: u8) {
        let rgb = vec![value; (3 * size.0 * size.1) as usize];
        let mut image = Vec::new();
        let kind = ExtendedColorType::Rgb8;
        match file.ends_with("png") {
            true => PngEncoder::new(&mut image).write_image(&rgb, size.0, size.1, kind).unwrap(),
            false => JpegEncoder::new(&mut image).write_image(&rgb, size.0, size.1, kind).unwrap(),
        }
        self.write(file, image);
    }

    fn open(&self) -> FolderSource {
        FolderSource::open(self.path(), None, None).unwrap()
    }

    fn refusal(&self) -> String {
        FolderSource::open(self.path(), None, None).unwrap_err().to_string()
    }
}

/// Layout, stamps, first raw depth, whether colour came and its first value.
fn read(source: &FolderSource, index: u64) -> (u16, bool, u8) {
    let n = (source.camera().width * source.camera().height) as usize;
    let (mut depth, mut colour) = (vec![9; n], vec![9; 3 * n]);
    let info = source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
    (depth[n / 2], info.has_colour, colour[3 * (n / 2)])
}

fn described(source: &FolderSource, name: &str) -> String {
    source
        .description()
        .into_iter()
        .find(|(known, _)| *known == name)
        .map(|(_, words)| words)
        .unwrap_or_default()
}

fn stamps(source: &FolderSource) -> Vec<i64> {
    (0..source.n_frames().unwrap()).map(|index| source.stamp_nanos(index).unwrap()).collect()
}

#[test]
fn seven_scenes() {
    let folder = Folder::new();
    let sequence = folder.path().join("chess/seq-01");
    let open = || FolderSource::open(&sequence, None, None);
    for k in 0..3_u16 {
        let name = |end: &str| format!("chess/seq-01/frame-{k:06}.{end}");
        folder.depth_of(&name("depth.png"), (640, 480), if k == 2 { u16::MAX } else { 1500 + k });
        folder.colour(&name("color.png"), (640, 480), 40);
        folder.write(&name("pose.txt"), if k == 1 { TURNED } else { IDENTITY });
    }
    let source = open().unwrap();
    assert!(
        source.warnings()[0].contains("the camera is assumed to be that of 7-Scenes, 585 px"),
        "{:?}",
        source.warnings()
    );
    assert!(described(&source, "layout").starts_with("7-Scenes"));
    assert_eq!(
        (source.camera().fx, source.camera().cx, source.camera().units_per_metre),
        (585.0, 320.0, 1000.0)
    );
    assert_eq!(stamps(&source), [0, 33_333_333, 66_666_667]);
    assert_eq!((read(&source, 1), read(&source, 2).0), ((1501, true, 40), u16::MAX));
    let truth = source.ground_truth().unwrap();
    assert_eq!((truth.len(), truth.poses[1].translation.x), (3, 0.25));
    assert!((truth.poses[1].rotation.angle() - std::f64::consts::PI).abs() < 1e-9);
    assert!(described(&source, "times").contains("30 frames a second are assumed"));
    let slow = SourceOptions { fps: Some(10.0), ..SourceOptions::default() };
    assert_eq!(stamps(&FolderSource::open_with(&sequence, &slow).unwrap())[2], 200_000_000);
    let bad = SourceOptions { fps: Some(0.0), ..SourceOptions::default() };
    let message = FolderSource::open_with(&sequence, &bad).unwrap_err().to_string();
    assert!(message.contains("--fps is 0, expected frames a second from 0.01"), "{message}");
    folder.write("chess/seq-01/frame-000001.pose.txt", "1 2 3");
    let source = open().unwrap();
    assert!(source.ground_truth().is_none());
    assert!(source.warnings()[1].contains("frame-000001.pose.txt: 3 numbers, expected the 16"));
    folder.write("chess/seq-01/frame-000001.pose.txt", IDENTITY.replace("0 0 1 0", "0 0 7 0"));
    assert!(open().unwrap().warnings()[1].contains("no rotation"));
}

#[test]
fn icl_nuim() {
    let folder = Folder::new();
    for k in 0..3 {
        folder.depth(&format!("depth/{k}.png"), 5000);
        folder.colour(&format!("rgb/{k}.png"), SIZE, 60);
    }
    folder.write(
        "associations.txt",
        "0 depth/0.png 0 rgb/0.png\n1 depth/1.png 1 rgb/1.png\n2 depth/2.png 2 rgb/2.png\n",
    );
    folder.write("livingRoom2.gt.freiburg", "1 0 0 -2.25 0 0 0 1\n2 0 0.5 -2.25 0 0 0 1\n");
    let source = folder.open();
    assert_eq!((source.camera().fy, source.camera().units_per_metre), (-480.0, 5000.0));
    assert_eq!(stamps(&source), [0, 33_333_333, 66_666_667]);
    assert_eq!(source.ground_truth().unwrap().stamps_nanos, [33_333_333, 66_666_667]);
    // Depth is what is named so, wherever it stands; colour's stamp is the earlier one.
    folder.write("associations.txt", "1.5 rgb/0.png 1.51 depth/0.png\n");
    folder.write("camera.toml", CAMERA);
    let source = folder.open();
    assert_eq!((stamps(&source), read(&source, 0)), (vec![1_500_000_000], (5000, true, 60)));
    for (text, expected) in [
        ("0 depth/0.png 0\n", "line 1: found '0 depth/0.png 0', expected: number depth/FILE number rgb/FILE"),
        ("0 depth/../../x 0 rgb/0.png\n", "line 1: found"),
        ("# nothing\n", "names no images"),
    ] {
        folder.write("associations.txt", text);
        assert!(folder.refusal().contains(expected), "{}", folder.refusal());
    }
}

#[test]
fn open3d() {
    let folder = Folder::new();
    for k in 0..2 {
        folder.depth(&format!("depth/{k:05}.png"), 1200);
        folder.colour(&format!("color/{k:05}.jpg"), SIZE, 80);
    }
    folder.write(
        "camera_intrinsic.json",
        r#"{"width": 32, "height": 24, "intrinsic_matrix": [30.0, 0, 0, 0, 31.0, 0, 15.5, 11.5, 1]}"#,
    );
    folder.write("odometry.log", "0 0 0\nnot looked at");
    folder.write("trajectory.log", format!("0 0 1\n{IDENTITY}1 1 2\n{TURNED}"));
    let source = folder.open();
    assert_eq!(
        (source.camera().fy, source.camera().cy, source.camera().units_per_metre),
        (31.0, 11.5, 1000.0)
    );
    assert_eq!((read(&source, 1).0, read(&source, 1).1), (1200, true));
    let truth = source.ground_truth().unwrap();
    assert_eq!((truth.stamps_nanos.clone(), truth.poses[1].translation.x), (vec![0, 33_333_333], 0.25));
    folder.write("trajectory.log", "0 0 1\n1 0 0");
    let source = folder.open();
    assert!(source.ground_truth().is_none());
    let warnings = source.warnings().join("\n");
    assert!(warnings.contains("trajectory.log: 6 numbers, expected blocks of 3 and 16"), "{warnings}");
    fs::remove_file(folder.path().join("trajectory.log")).unwrap();
    fs::remove_file(folder.path().join("odometry.log")).unwrap();
    fs::remove_file(folder.path().join("camera_intrinsic.json")).unwrap();
    assert!(folder.refusal().contains("has no camera.toml"));
}

#[test]
fn redwood() {
    let folder = Folder::new();
    for (k, micros) in [(1, 0), (2, 33_369), (3, 66_700)] {
        folder.depth(&format!("depth/{k:07}-{micros:012}.png"), 1000);
        folder.colour(&format!("rgb/{k:07}-{:012}.jpg", micros + 5000), SIZE, 80);
    }
    folder.write("camera.toml", CAMERA);
    let source = folder.open();
    assert_eq!(stamps(&source), [0, 33_369_000, 66_700_000]);
    assert_eq!((source.pairing().n_pairs, source.pairing().largest_difference_nanos), (3, 5_000_000));
    assert!(described(&source, "times").contains("microseconds in the names"));
}

#[test]
fn scannet() {
    let folder = Folder::new();
    let large = (81, 60);
    for k in [0, 10, 20] {
        folder.depth(&format!("depth/{k}.png"), 2000);
        folder.colour(&format!("color/{k}.jpg"), large, 120);
        folder
            .write(&format!("pose/{k}.txt"), if k == 10 { "-inf ".repeat(16) } else { IDENTITY.to_owned() });
    }
    let matrix = |f: f64, cx: f64, cy: f64| format!("{f} 0 {cx} 0\n0 {f} {cy} 0\n0 0 1 0\n0 0 0 1\n");
    folder.write("intrinsic/intrinsic_depth.txt", matrix(30.0, 15.5, 11.5));
    folder.write("intrinsic/intrinsic_color.txt", matrix(75.0, 40.0, 29.5));
    let source = folder.open();
    assert!(described(&source, "layout").starts_with("ScanNet"));
    assert_eq!((source.camera().fx, source.camera().cx), (30.0, 15.5));
    assert_eq!(stamps(&source), [0, 333_333_333, 666_666_667]);
    assert_eq!(source.ground_truth().unwrap().len(), 2);
    let (depth, has_colour, value) = read(&source, 1);
    assert!(depth == 2000 && has_colour && value.abs_diff(120) < 4);
    assert!(described(&source, "colour").contains("81x60 px, warped"), "{}", described(&source, "colour"));
    fs::remove_file(folder.path().join("intrinsic/intrinsic_color.txt")).unwrap();
    let source = folder.open();
    assert!(source.warnings()[0].contains("colour is left out") && !read(&source, 1).1);
}

#[test]
fn replica() {
    let folder = Folder::new();
    for k in 0..2 {
        folder.depth(&format!("room0/results/depth{k:06}.png"), 6554);
        folder.colour(&format!("room0/results/frame{k:06}.jpg"), SIZE, 120);
    }
    let line = |pose: &str| pose.replace('\n', " ") + "\n";
    folder.write("room0/traj.txt", line(IDENTITY) + &line(TURNED));
    let open = || FolderSource::open(&folder.path().join("room0"), None, None);
    let message = open().unwrap_err().to_string();
    assert!(message.contains("no cam_params.json here or in the folder above"), "{message}");
    let camera =
        r#"{"camera": {"w": 32, "h": 24, "fx": 30.0, "fy": 30.0, "cx": 15.5, "cy": 11.5, "scale": 6553.5}}"#;
    folder.write("cam_params.json", camera);
    let source = open().unwrap();
    assert_eq!(
        (source.camera().units_per_metre, read(&source, 0).0, read(&source, 0).1),
        (6553.5, 6554, true)
    );
    assert_eq!(source.ground_truth().unwrap().poses[1].translation.x, 0.25);
    folder.write("cam_params.json", "{}");
    assert!(open().unwrap_err().to_string().contains("cam_params.json: missing field `camera`"));
}

#[test]
fn stray_scanner() {
    let folder = Folder::new();
    for k in 0..3 {
        folder.depth(&format!("depth/{k:06}.png"), 1800);
        let confidence = vec![if k == 1 { 0 } else { 2 }; (SIZE.0 * SIZE.1) as usize];
        let mut png = Vec::new();
        PngEncoder::new(&mut png).write_image(&confidence, SIZE.0, SIZE.1, ExtendedColorType::L8).unwrap();
        folder.write(&format!("confidence/{k:06}.png"), png);
    }
    folder.write("camera_matrix.csv", "1440.0, 0.0, 960.0\n0.0, 1440.0, 720.0\n0.0, 0.0, 1.0\n");
    let row =
        |time: f64, frame: u64| format!("{time}, {frame:06}, 0.5, 0, 0, 0, 0, 0, 1, 1440, 1440, 960, 720\n");
    let header = "timestamp, frame, x, y, z, qx, qy, qz, qw, fx, fy, cx, cy\n";
    folder.write("odometry.csv", format!("{header}{}{}", row(7.5, 0), row(7.6, 1)));
    folder.write("rgb.mp4", "");
    let source = folder.open();
    // The matrix is that of the video, 1920x1440 px.
    assert_eq!((source.camera().fx, source.camera().cx, source.camera().cy), (24.0, 16.0, 12.0));
    assert_eq!(stamps(&source), [7_500_000_000, 7_600_000_000]);
    assert_eq!((read(&source, 0).0, read(&source, 1).0), (1800, 0), "low confidence is no depth");
    assert_eq!(source.ground_truth().unwrap().poses[0].translation.x, 0.5);
    let warnings = source.warnings().join("\n");
    assert!(
        warnings.contains("no frame has colour: it is a video")
            && warnings.contains("1 depth images have no time"),
        "{warnings}"
    );
    assert!(
        warnings.contains("ffmpeg -i rgb.mp4 -fps_mode passthrough -start_number 0 rgb/%06d.jpg"),
        "{warnings}"
    );
    // Its images, written by that command.
    (0..2).for_each(|k| folder.colour(&format!("rgb/{k:06}.jpg"), (64, 48), 90 + k));
    let source = folder.open();
    assert!(described(&source, "colour").contains("64x48 px, warped to depth by both cameras"));
    assert_eq!(read(&source, 0), (1800, true, 90));
    let taken = source.colour_as_taken(1).unwrap().unwrap();
    assert_eq!((taken.camera.camera.fx, taken.rgb.len()), (48.0, 64 * 48 * 3));
    assert!(taken.file.unwrap().ends_with("rgb/000001.jpg"));
    // More than the video has frames, as ffmpeg writes them to make their times even.
    assert!(!source.warnings().join("\n").contains("in rgb/"), "{:?}", source.warnings());
    (2..5).for_each(|k| folder.colour(&format!("rgb/{k:06}.jpg"), (64, 48), 90));
    let warnings = folder.open().warnings().join("\n");
    assert!(warnings.contains("3 of 5 images in rgb/ have no row in odometry.csv"), "{warnings}");
    assert!(warnings.contains("-fps_mode passthrough"), "{warnings}");
    folder.write("odometry.csv", format!("{header}1.0, 0, nan, 0, 0, 0, 0, 0, 1\n"));
    assert!(folder.refusal().contains("expected: timestamp, frame, x, y, z"), "{}", folder.refusal());
}

#[test]
fn what_is_not_read_is_named() {
    let folder = Folder::new();
    assert!(
        folder.refusal().contains("no layout that is known") && folder.refusal().contains("it holds nothing")
    );
    folder.write("notes.md", "words");
    folder.write("seq-01/frame-000000.depth.png", "");
    let message = folder.refusal();
    assert!(message.contains("7-Scenes") && message.contains("it holds notes.md, seq-01"), "{message}");
    assert!(message.contains("did you mean") && message.contains("seq-01?"), "{message}");
    folder.write("a.oni", "NI10");
    assert!(folder.refusal().contains("a recording of OpenNI, which is not read: play it"));
}
