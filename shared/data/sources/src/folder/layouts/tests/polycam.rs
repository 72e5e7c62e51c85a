//! Polycam's raw data, as its documentation and its exports have it.

use super::*;
use crate::folder::layouts::polycam::NAME;

const TIMES: [u64; 3] = [293_814_600_474, 293_814_900_474, 293_815_500_475];
/// Low, medium and high, as exports have it.
const CONFIDENCE: [u8; 3] = [0, 54, 255];

/// A camera of colour, twice as large as depth, a step to the right and a half turn about y.
fn camera(focal: f64, step: f64) -> String {
    format!(
        r#"{{"fx": {focal}, "fy": 60.0, "cx": 31.0, "cy": 24.0, "width": 64, "height": 48, "blur_score": 30.5,
        "t_00": -1.0, "t_01": 0.0, "t_02": 0.0, "t_03": {step}, "t_10": 0.0, "t_11": 1.0, "t_12": 0.0, "t_13": 0.0,
        "t_20": 0.0, "t_21": 0.0, "t_22": -1.0, "t_23": 0.0, "timestamp": 1.5}}"#
    )
}

fn capture(at: &str) -> Folder {
    let folder = Folder::new();
    for (time, raw) in TIMES.into_iter().zip(1800..) {
        folder.depth(&format!("{at}depth/{time}.png"), raw);
        folder.depth(&format!("{at}depth/{time}.Clean.png"), 7);
        folder.colour(&format!("{at}images/{time}.jpg"), (64, 48), 90);
        folder.write(&format!("{at}cameras/{time}.json"), camera(62.0, 0.25));
        let confidence: Vec<u8> = (0..SIZE.0 * SIZE.1).map(|k| CONFIDENCE[k as usize % 3]).collect();
        let mut png = Vec::new();
        PngEncoder::new(&mut png).write_image(&confidence, SIZE.0, SIZE.1, ExtendedColorType::L8).unwrap();
        folder.write(&format!("{at}confidence/{time}.png"), png);
    }
    folder.write("mesh_info.json", r#"{"bboxSize": [3.2, 3.0, 4.1]}"#);
    folder.write("polycam.mp4", "not looked at");
    folder
}

#[test]
fn depth_confidence_colour_and_poses_are_read() {
    // The archive without and with its `keyframes`, and that folder itself.
    for at in ["keyframes/", ""] {
        let folder = capture(at);
        let source = folder.open();
        assert_eq!(described(&source, "layout"), NAME);
        let camera = source.camera();
        assert_eq!((camera.fx, camera.fy, camera.cx, camera.cy), (31.0, 30.0, 15.5, 12.0));
        assert_eq!(camera.units_per_metre, 1000.0);
        assert_eq!(stamps(&source), TIMES.map(|time| time as i64 * 1000));
        let n = (SIZE.0 * SIZE.1) as usize;
        let (mut depth, mut colour) = (vec![9; n], vec![9; 3 * n]);
        let info = source.read(1, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
        assert_eq!(depth[..6], [0, 1801, 1801, 0, 1801, 1801], "low confidence is no depth");
        assert!(info.has_colour && described(&source, "colour").contains("64x48 px, warped to depth"));
        let truth = source.ground_truth().unwrap();
        // Forward is the other side of backward.
        let forward = truth.poses[1].rotation * nalgebra::Vector3::z();
        assert!((truth.poses[1].translation.x, truth.len()) == (0.25, 3) && forward.z > 0.999);
        let down = truth.poses[1].rotation * nalgebra::Vector3::y();
        assert!(down.y < -0.999, "{down}");
        assert!(source.warnings().is_empty(), "{:?}", source.warnings());
    }
}

#[test]
fn optimised_poses_are_the_ones_compared_with() {
    let folder = capture("keyframes/");
    for time in TIMES {
        folder.write(&format!("keyframes/corrected_cameras/{time}.json"), camera(70.0, 0.5));
        folder.colour(&format!("keyframes/corrected_images/{time}.jpg"), (64, 48), 20);
    }
    let source = folder.open();
    // Of undistorted images another camera is true than of depth.
    assert_eq!((source.camera().fx, read(&source, 0).2), (31.0, 90));
    assert_eq!(source.ground_truth().unwrap().poses[0].translation.x, 0.5);
    assert!(described(&source, "ground truth of").contains("corrected_cameras"));
    // Where the others are gone they are what there is.
    for gone in ["cameras", "images"] {
        fs::remove_dir_all(folder.path().join("keyframes").join(gone)).unwrap();
    }
    let source = folder.open();
    assert_eq!((source.camera().fx, read(&source, 0).2), (35.0, 20));
}

#[test]
fn what_is_wrong_is_named() {
    let folder = capture("keyframes/");
    folder.write(&format!("keyframes/cameras/{}.json", TIMES[0]), "{\"fx\": 62.0");
    folder.write(&format!("keyframes/cameras/{}.json", TIMES[2]), camera(64.0, 0.25));
    let source = folder.open();
    assert_eq!((source.n_frames(), source.ground_truth().unwrap().len()), (Some(3), 2));
    let warnings = source.warnings().join("\n");
    assert!(warnings.contains("1 camera files cannot be read"), "{warnings}");
    assert!(warnings.contains("the focal length changes by 3.1 % (autofocus)"), "{warnings}");
    for time in TIMES {
        folder.write(&format!("keyframes/cameras/{time}.json"), "{}");
    }
    let refusal = folder.refusal();
    assert!(refusal.contains("293814600474.json: missing field `fx`"), "{refusal}");
    // Frames that were renamed have no times.
    let renamed = capture("keyframes/");
    for (time, k) in TIMES.into_iter().zip(0..) {
        for (sub, end) in [("depth", "png"), ("cameras", "json")] {
            let folder = renamed.path().join("keyframes").join(sub);
            fs::rename(folder.join(format!("{time}.{end}")), folder.join(format!("{k:05}.{end}"))).unwrap();
        }
    }
    let refusal = renamed.refusal();
    assert!(refusal.contains("step by 1, expected times in microseconds"), "{refusal}");
    let slow = SourceOptions { fps: Some(4.0), ..SourceOptions::default() };
    let source = FolderSource::open_with(renamed.path(), &slow).unwrap();
    assert_eq!(stamps(&source), [0, 250_000_000, 500_000_000]);
}
