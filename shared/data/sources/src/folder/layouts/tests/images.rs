//! What images of a folder may be: distances, of any size, arrays, seen through a fisheye.

use super::*;

#[test]
fn depth_along_the_ray_becomes_depth() {
    let folder = Folder::new();
    folder.depth("0.png", 2000);
    folder.write("depth.txt", "0.5 0.png\n");
    folder.write("camera.toml", format!("depth = \"distance\"\n{CAMERA}"));
    let source = folder.open();
    let n = (SIZE.0 * SIZE.1) as usize;
    let (mut depth, mut colour) = (vec![9; n], vec![9; 3 * n]);
    source.read(0, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
    let length = source.camera().ray(0.0, 0.0).norm();
    assert_eq!(depth[0], (2000.0 / length).round() as u16);
    assert!(described(&source, "depth").contains("distances along the ray"));
}

#[test]
fn large_and_upright_images_are_reduced() {
    let folder = Folder::new();
    for (size, expected) in
        [((960, 1280), (960, 1280)), ((1920, 1200), (960, 600)), ((2048, 1536), (1024, 768))]
    {
        folder.depth_of("0.png", size, 2000);
        folder.write("depth.txt", "0.5 0.png\n");
        let (cx, cy) = (f64::from(size.0) / 2.0 - 0.5, f64::from(size.1) / 2.0 - 0.5);
        folder.write("camera.toml", format!("width = {}\nheight = {}\nfx = 900.0\nfy = 900.0\ncx = {cx}\ncy = {cy}\nunits_per_metre = 1000.0\n", size.0, size.1));
        let spec = crate::SourceSpec::parse(&folder.path().display().to_string());
        let source = crate::open(&spec, &SourceOptions::default()).unwrap();
        let camera = source.camera();
        assert_eq!((camera.width, camera.height), expected);
        assert_eq!(camera.cx, f64::from(expected.0) / 2.0 - 0.5);
        let is_said = source.warnings().join("\n").contains("px are reduced to");
        assert_eq!(is_said, size != expected, "{:?}", source.warnings());
        let n = (expected.0 * expected.1) as usize;
        let (mut depth, mut colour) = (vec![9; n], vec![9; 3 * n]);
        let info = source.read(0, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
        assert!(depth.iter().all(|raw| *raw == 2000) && !info.has_colour && colour.iter().all(|c| *c == 0));
    }
}

#[test]
fn depth_may_be_an_array_of_numpy_or_a_pgm() {
    let folder = Folder::new();
    let head = "{'descr': '<f4', 'fortran_order': False, 'shape': (24, 32), }\n";
    let metres: Vec<u8> = std::iter::repeat_n(1.25_f32.to_le_bytes(), 768).flatten().collect();
    let array =
        [b"\x93NUMPY\x01\x00", &(head.len() as u16).to_le_bytes()[..], head.as_bytes(), &metres].concat();
    folder.write("depth/0.npy", &array);
    folder.write("depth/1.npy", &array);
    folder.write("camera.toml", CAMERA);
    let source = folder.open();
    assert_eq!((source.n_frames(), read(&source, 1).0), (Some(2), 1250));
    source.inspect(0).unwrap();
    let raw: Vec<u8> = std::iter::repeat_n(900_u16.to_be_bytes(), 768).flatten().collect();
    folder.write("a.pgm", [b"P5 32 24 65535\n", &raw[..]].concat());
    folder.write("depth.txt", "1.5 a.pgm\n");
    assert_eq!(read(&folder.open(), 0).0, 900);
}

#[test]
fn a_fisheye_is_taken_out_of_depth_and_of_the_colour_that_is_registered_to_it() {
    let folder = Folder::new();
    // Each pixel tells its column.
    let depth: Vec<u16> = (0..768).map(|pixel| 1000 + pixel % 32).collect();
    let rgb: Vec<u8> = (0..768).flat_map(|pixel| [(pixel % 32) as u8; 3]).collect();
    let (mut deep, mut colour) = (Vec::new(), Vec::new());
    let bytes = bytemuck::cast_slice(&depth);
    PngEncoder::new(&mut deep).write_image(bytes, SIZE.0, SIZE.1, ExtendedColorType::L16).unwrap();
    PngEncoder::new(&mut colour).write_image(&rgb, SIZE.0, SIZE.1, ExtendedColorType::Rgb8).unwrap();
    folder.write("depth/0.png", &deep);
    folder.write("color/0.png", &colour);
    folder.write(
        "camchain.yaml",
        "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [0.1, 0, 0, 0]\n  distortion_model: equidistant\n  \
         intrinsics: [15, 15, 15.5, 11.5]\n  resolution: [32, 24]\n",
    );
    let source = folder.open();
    assert!(
        described(&source, "camera").ends_with("fisheye lens taken out of the images"),
        "{}",
        described(&source, "camera")
    );
    assert!(!source.camera().is_distorted());
    let (mut depth, mut colour) = (vec![0; 768], vec![0; 3 * 768]);
    source.read(0, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
    for column in [1, 9, 20, 30] {
        let at = 32 * 12 + column;
        // The column whose ray is as far from the axis, by the lens.
        let (x, y) = ((column as f64 - 15.5) / 15.0, 0.5 / 15.0);
        let radius = f64::hypot(x, y);
        let angle = libm::atan(radius);
        let expected = 15.5 + 15.0 * x / radius * (angle + 0.1 * angle.powi(3));
        let found = (f64::from(depth[at]) - 1000.0, f64::from(colour[3 * at]));
        assert!((found.0 - expected).abs() <= 0.51 && found.0 == found.1, "{column}: {found:?} {expected}");
    }
}

#[test]
fn a_depth_image_that_is_listed_at_two_times_is_named() {
    let folder = Folder::new();
    (0..6).for_each(|k| folder.depth(&format!("{k}.png"), 1500 + k));
    let lines = |names: [u16; 6]| -> String {
        names
            .iter()
            .enumerate()
            .map(|(k, name)| format!("{:.2} {name}.png\n", 1.0 + k as f64 / 30.0))
            .collect()
    };
    folder.write("camera.toml", CAMERA);
    folder.write("depth.txt", lines([0, 1, 2, 3, 4, 2]));
    let warnings = folder.open().warnings().join("\n");
    assert!(
        warnings.contains("1 depth images are listed at more than one time, the first: 2.png"),
        "{warnings}"
    );
    folder.write("depth.txt", lines([0, 1, 2, 3, 4, 5]));
    assert!(!folder.open().warnings().join("\n").contains("listed"));
}
