//! Folders made on the spot, good and bad, with a check on each message.

use super::*;
use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder, codecs::png::PngEncoder};
use std::fs;

const WIDTH: u32 = 20;
const HEIGHT: u32 = 16;
const N_PIXELS: usize = (WIDTH * HEIGHT) as usize;
const CAMERA: &str =
    "width = 20\nheight = 16\nfx = 20.0\nfy = 20.0\ncx = 9.5\ncy = 7.5\nunits_per_metre = 1000.0\n";

fn png(bytes: &[u8], width: u32, height: u32, pixels: ExtendedColorType) -> Vec<u8> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(bytes, width, height, pixels).unwrap();
    file
}

fn depth_png(first: u16) -> Vec<u8> {
    let values: Vec<u16> = (0..N_PIXELS as u16).map(|k| first + k).collect();
    png(bytemuck::cast_slice(&values), WIDTH, HEIGHT, ExtendedColorType::L16)
}

/// Three depth images, two colour images near the first and the last, a camera.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::write(at.join("camera.toml"), CAMERA).unwrap();
    fs::write(at.join("depth.txt"), "# depth\n0.000 d0.png\n0.100 d1.png\n0.200 d2.png\n").unwrap();
    fs::write(at.join("rgb.txt"), "# rgb\n0.005 c0.jpg\n0.205 c2.png\n").unwrap();
    for k in 0..3 {
        fs::write(at.join(format!("d{k}.png")), depth_png(1000 * k)).unwrap();
    }
    let grey = vec![100; 3 * N_PIXELS];
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, 95)
        .write_image(&grey, WIDTH, HEIGHT, ExtendedColorType::Rgb8)
        .unwrap();
    fs::write(at.join("c0.jpg"), jpeg).unwrap();
    fs::write(at.join("c2.png"), png(&[7; N_PIXELS], WIDTH, HEIGHT, ExtendedColorType::L8)).unwrap();
    folder
}

fn read(folder: &Path, index: u64) -> Result<(FrameInfo, Vec<u16>, Vec<u8>), SourceError> {
    let source = FolderSource::open(folder, None, None)?;
    let (mut depth, mut colour) = (vec![9; N_PIXELS], vec![9; 3 * N_PIXELS]);
    let info = source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;
    Ok((info, depth, colour))
}

fn check(break_it: impl Fn(&Path), index: u64, expected: &[&str]) {
    let folder = folder();
    break_it(folder.path());
    let message = read(folder.path(), index).unwrap_err().to_string();
    for part in expected {
        assert!(message.contains(part), "'{message}' lacks '{part}'");
    }
}

#[test]
fn a_gyroscope_beside_the_images_turns_the_frames() {
    let folder = folder();
    let rates: String = (0..50).map(|k| format!("{:.3} 0 1.5 0 0 9.8 0\n", f64::from(k) * 0.005)).collect();
    fs::write(folder.path().join("imu.txt"), format!("# stamp gx gy gz ax ay az\n{rates}")).unwrap();
    let rotation = |index| read(folder.path(), index).unwrap().0.rotation.unwrap();
    let turned = rotation(0).until(&rotation(2), 0.2);
    assert!((turned.rate_rad_per_s(0.2) - nalgebra::Vector3::new(0.0, 1.5, 0.0)).norm() < 1e-9);
    check(|at| fs::write(at.join("imu.txt"), "0.0 1 2\n").unwrap(), 0, &["imu.txt, line 1", "gx gy gz"]);
}

#[test]
fn frames_are_those_of_depth_with_colour_where_it_is_near() {
    let folder = folder();
    let (info, depth, colour) = read(folder.path(), 0).unwrap();
    assert_eq!(info, FrameInfo { stamp_nanos: 0, has_colour: true, rotation: None, up: None });
    assert_eq!((depth[0], depth[N_PIXELS - 1]), (0, N_PIXELS as u16 - 1));
    assert!(colour.iter().all(|&c| c.abs_diff(100) <= 2));
    let (info, depth, colour) = read(folder.path(), 1).unwrap();
    assert_eq!(info, FrameInfo { stamp_nanos: 100_000_000, has_colour: false, rotation: None, up: None });
    assert!(depth[0] == 1000 && colour.iter().all(|&c| c == 0));
    let (_, _, colour) = read(folder.path(), 2).unwrap();
    assert!(colour.iter().all(|&c| c == 7));
    let source = FolderSource::open(folder.path(), None, Some(2)).unwrap();
    assert_eq!(
        (source.n_frames(), source.stamp_nanos(1), source.stamp_nanos(2)),
        (Some(2), Some(100_000_000), None)
    );
    assert_eq!((source.pairing().n_pairs, source.pairing().largest_difference_nanos), (1, 5_000_000));
    assert!(source.ground_truth().is_none());
}

#[test]
fn a_missing_folder_list_or_image_is_named() {
    let message = FolderSource::open(Path::new("no/such"), None, None).unwrap_err().to_string();
    assert!(message.contains("no source 'no/such': expected room, corridor"), "{message}");
    check(|at| fs::remove_file(at.join("depth.txt")).unwrap(), 0, &["depth.txt: ", "No such file"]);
    check(|at| fs::remove_file(at.join("d1.png")).unwrap(), 1, &["frame 1, ", "d1.png: "]);
}

#[test]
fn a_missing_camera_is_answered_with_what_to_give() {
    check(
        |at| fs::remove_file(at.join("camera.toml")).unwrap(),
        0,
        &["has no camera.toml", "--camera FILE or --camera freiburg1|freiburg2|freiburg3|icl"],
    );
    let message = FolderSource::open(folder().path(), Some("webcam"), None).unwrap_err().to_string();
    assert!(message.contains("no camera 'webcam'"), "{message}");
}

#[test]
fn bad_images_are_named_with_frame_file_found_and_expected() {
    let write =
        |name: &'static str, bytes: Vec<u8>| move |at: &Path| fs::write(at.join(name), &bytes).unwrap();
    let truncated = depth_png(0)[..200].to_vec();
    check(
        write("d1.png", truncated),
        1,
        &["frame 1, ", "d1.png: the image is cut short or damaged", "whole PNG"],
    );
    check(write("d0.png", Vec::new()), 0, &["frame 0, ", "nothing (0 bytes)", "expected a PNG"]);
    check(write("d0.png", b"hello world".to_vec()), 0, &["begins with 'hello wo', expected a PNG"]);
    let eight = png(&[1; N_PIXELS], WIDTH, HEIGHT, ExtendedColorType::L8);
    check(
        write("d2.png", eight),
        2,
        &["frame 2", "1 channel of 8 bits, expected 1 channel of 16 bits; a picture of depth"],
    );
    let small = png(&[1; 50], 5, 5, ExtendedColorType::L16);
    check(write("d0.png", small), 0, &["depth image is 5x5 px, expected 20x16 px"]);
    let other_size = png(&[1; 3 * 100], 10, 10, ExtendedColorType::Rgb8);
    check(write("c2.png", other_size), 2, &["c2.png: colour image is 10x10 px, expected 20x16 px"]);
    check(
        |at| {
            let whole = fs::read(at.join("c0.jpg")).unwrap();
            fs::write(at.join("c0.jpg"), &whole[..whole.len() - 20]).unwrap();
        },
        0,
        &["c0.jpg: the image is cut short or damaged", "whole JPEG"],
    );
}

#[test]
fn colour_of_16_bits_a_channel_has_its_higher_bytes() {
    let folder = folder();
    let values = vec![0x3412_u16; 3 * N_PIXELS];
    let deep = png(bytemuck::cast_slice(&values), WIDTH, HEIGHT, ExtendedColorType::Rgb16);
    fs::write(folder.path().join("c2.png"), deep).unwrap();
    let (info, _, colour) = read(folder.path(), 2).unwrap();
    assert!(info.has_colour && colour.iter().all(|c| *c == 0x34), "{:?}", &colour[..6]);
}

#[test]
fn every_cut_of_an_image_is_an_error_and_never_a_panic() {
    let folder = folder();
    for name in ["d0.png", "c0.jpg"] {
        let whole = fs::read(folder.path().join(name)).unwrap();
        for end in (0..whole.len() - 2).step_by(7) {
            fs::write(folder.path().join(name), &whole[..end]).unwrap();
            assert!(read(folder.path(), 0).is_err(), "{name} cut at {end} of {}", whole.len());
        }
        fs::write(folder.path().join(name), &whole).unwrap();
        assert!(read(folder.path(), 0).is_ok());
    }
}

#[test]
fn bad_ground_truth_is_named_with_its_line() {
    let folder = folder();
    let truth = folder.path().join("groundtruth.txt");
    fs::write(&truth, "# t\n0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n2 0 0 0 0 0 0 1 9\n3 0 0 0 0 0 0 1\n")
        .unwrap();
    let source = FolderSource::open(folder.path(), None, None).unwrap();
    assert_eq!(source.ground_truth().unwrap().len(), 2);
    let warning = source.warnings().join("\n");
    assert!(warning.contains("2 rows of the ground truth are left out, the first: "), "{warning}");
    assert!(warning.contains("groundtruth.txt, line 3: tx is 'nan', expected a finite number"), "{warning}");
    fs::write(&truth, "words\n").unwrap();
    let source = FolderSource::open(folder.path(), None, None).unwrap();
    assert!(source.ground_truth().is_none());
    assert!(source.warnings()[0].contains("the ground truth is left out: "), "{:?}", source.warnings());
}

#[test]
fn frames_beyond_the_end_and_wrong_slices_are_refused() {
    check(|_| {}, 3, &["frame 3 was asked for, the source has frames 0 to 2"]);
    let folder = folder();
    let source = FolderSource::open(folder.path(), None, None).unwrap();
    let message =
        source.read(0, &mut FrameBuffers { depth: &mut [0; 3], colour: &mut [] }).unwrap_err().to_string();
    assert!(message.contains("buffers hold 3 depth and 0 colour values, expected 320 and 960"), "{message}");
}

#[test]
fn depth_alone_needs_no_list_of_colour() {
    for text in [None, Some("# nothing\n")] {
        let folder = folder();
        let list = folder.path().join("rgb.txt");
        match text {
            None => fs::remove_file(&list).unwrap(),
            Some(text) => fs::write(&list, text).unwrap(),
        }
        let (info, depth, colour) = read(folder.path(), 0).unwrap();
        assert!(!info.has_colour && depth[1] == 1 && colour.iter().all(|&c| c == 0));
        let source = FolderSource::open(folder.path(), None, None).unwrap();
        let warning = source.warnings().join("\n");
        assert!(warning.contains("no frame has colour: ") && warning.contains("rgb.txt"), "{warning}");
    }
}

#[test]
fn colour_is_left_out_where_that_is_asked_for_or_its_size_is_another() {
    let folder = folder();
    let options = SourceOptions { color_topic: Some("none".into()), ..SourceOptions::default() };
    let source = FolderSource::open_with(folder.path(), &options).unwrap();
    assert_eq!((source.pairing().n_pairs, source.warnings().len()), (0, 0));
    for name in ["c0.jpg", "c2.png"] {
        let other = png(&[1; 3 * 100], 10, 10, ExtendedColorType::Rgb8);
        fs::write(folder.path().join(name), other).unwrap();
    }
    let source = FolderSource::open(folder.path(), None, None).unwrap();
    let warning = &source.warnings()[0];
    assert!(
        warning.contains("colour is 10x10 px, depth 20x16 px") && warning.contains("left out"),
        "{warning}"
    );
    assert!(!read(folder.path(), 0).unwrap().0.has_colour);
}

#[test]
fn colour_of_the_camera_that_the_camera_file_states_is_warped_whatever_its_size() {
    let folder = folder();
    // Half the focal length, 0.1 m to the right.
    let lens = "[colour]\nwidth = 20\nheight = 16\nfx = 10.0\nfy = 10.0\ncx = 9.5\ncy = 7.5\n";
    let place = "colour_from_depth = [-0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n";
    let write = |lens: &str| {
        let file = format!("colour_registered = false\n{CAMERA}{lens}{place}");
        fs::write(folder.path().join("camera.toml"), file).unwrap();
    };
    write(lens);
    let columns: Vec<u8> = (0..HEIGHT).flat_map(|_| (0..WIDTH).flat_map(|c| [10 * c as u8, 7, 7])).collect();
    fs::write(folder.path().join("c2.png"), png(&columns, WIDTH, HEIGHT, ExtendedColorType::Rgb8)).unwrap();
    let source = FolderSource::open(folder.path(), None, None).unwrap();
    assert!(source.camera().colour_registered && source.warnings().is_empty());
    let (info, depth, colour) = read(folder.path(), 2).unwrap();
    assert!(info.has_colour);
    for column in [4, 9, 15] {
        let place = 20 * 8 + column;
        let depth_m = f64::from(depth[place]) * 1e-3;
        let expected = 9.5 + 10.0 * ((column as f64 - 9.5) / 20.0 - 0.1 / depth_m);
        assert_eq!(f64::from(colour[3 * place]) / 10.0, (expected + 0.5).floor(), "column {column}");
    }
    write(&lens.replace("width = 20", "width = 40"));
    let source = FolderSource::open(folder.path(), None, None).unwrap();
    let warning = &source.warnings()[0];
    assert!(warning.contains("colour is 20x16 px, the camera file's [colour] says 40x16 px"), "{warning}");
    assert!(!read(folder.path(), 2).unwrap().0.has_colour);
}

#[test]
fn a_missing_or_broken_image_costs_itself_alone() {
    let folder = folder();
    fs::remove_file(folder.path().join("d1.png")).unwrap();
    fs::write(folder.path().join("c0.jpg"), [0xff, 0xd8]).unwrap();
    let source = FolderSource::open(folder.path(), None, None).unwrap();
    let salvaged = |index| {
        let (mut depth, mut colour) = (vec![9; N_PIXELS], vec![9; 3 * N_PIXELS]);
        let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
        let (info, error) = source.read_what_is_there(index, &mut buffers).unwrap();
        (info, error.map(|error| error.to_string()), depth, colour)
    };
    let (info, error, depth, colour) = salvaged(0);
    assert!(error.unwrap().contains("frame 0, ") && !info.has_colour);
    assert!(depth[1] == 1 && colour.iter().all(|&c| c == 0), "depth is whole");
    let (info, error, depth, _) = salvaged(1);
    assert!(error.unwrap().contains("d1.png: ") && depth.iter().all(|&raw| raw == 0));
    assert_eq!(info.stamp_nanos, 100_000_000);
    assert_eq!(salvaged(2).1, None);
    let report = crate::check(&source, 3).unwrap();
    assert_eq!(report.broken_frames, [0, 1]);
    assert!(
        report.warnings[0].contains("c0.jpg") && report.warnings[1].contains("d1.png"),
        "{:?}",
        report.warnings
    );
}

#[test]
fn the_camera_of_a_raw_download_is_that_of_its_name() {
    let folder = folder();
    fs::remove_file(folder.path().join("camera.toml")).unwrap();
    let raw = folder.path().join("rgbd_dataset_freiburg2_desk");
    fs::create_dir(&raw).unwrap();
    fs::copy(folder.path().join("depth.txt"), raw.join("depth.txt")).unwrap();
    let source = FolderSource::open(&raw, None, None).unwrap();
    assert_eq!(source.camera(), &tessera_frames::named_camera("freiburg2").unwrap());
    let head = "# depth maps\n# file: 'rgbd_dataset_freiburg1_rpy.bag'\n# timestamp filename\n0.0 d0.png\n";
    fs::write(folder.path().join("depth.txt"), head).unwrap();
    let source = FolderSource::open(folder.path(), None, None).unwrap();
    assert_eq!(source.camera(), &tessera_frames::named_camera("freiburg1").unwrap());
    assert_eq!(source.doubts().len(), 0);
    fs::write(folder.path().join("camera.toml"), CAMERA).unwrap();
    let doubted = FolderSource::open(folder.path(), None, None).unwrap();
    assert!(
        doubted.doubts()[0].contains("fx = 20, units_per_metre = 1000; that of freiburg1"),
        "{:?}",
        doubted.doubts()
    );
    let (_, words) = &source.description()[1];
    assert!(words.contains("freiburg1, from the head of depth.txt"), "{words}");
}
