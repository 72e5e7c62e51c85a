//! Names, lists and files near those that are known: read as they are meant, or told.

use super::*;
use crate::folder::video::tests::video;

#[test]
fn colour_that_is_numbered_from_one_is_that_of_depth_from_zero() {
    let folder = Folder::new();
    for k in 0..12_u8 {
        folder.depth(&format!("depth/{k}.png"), 1500);
        folder.colour(&format!("color/{}.png", k + 1), SIZE, 90 + k);
    }
    folder.write("camera.toml", CAMERA);
    let source = folder.open();
    assert_eq!((source.pairing().n_pairs, source.pairing().largest_difference_nanos), (12, 0));
    assert_eq!((read(&source, 0).2, read(&source, 11).2), (90, 101));
    assert!(
        source.warnings()[0].contains("colour is numbered from 1, depth from 0"),
        "{:?}",
        source.warnings()
    );
    // With one more of either it may be that one is missing: numbers decide.
    folder.colour("color/0.png", SIZE, 89);
    let source = folder.open();
    assert_eq!((read(&source, 0).2, source.warnings()), (89, &[] as &[String]));
}

#[test]
fn numbers_in_wide_steps_are_told() {
    let folder = Folder::new();
    for k in 0..9 {
        folder.depth(&format!("depth/{}.png", 100 * k), 1500);
    }
    folder.write("camera.toml", CAMERA);
    let source = folder.open();
    let words = source.warnings().join("\n");
    assert!(
        words.contains("rise by 100: they are taken for frames, 3.333 s apart at 30 a second"),
        "{words}"
    );
    let slow = SourceOptions { fps: Some(10.0), ..SourceOptions::default() };
    let source = FolderSource::open_with(folder.path(), &slow).unwrap();
    assert!(!source.warnings().join("\n").contains("rise by"), "{:?}", source.warnings());
}

#[test]
fn a_list_of_pairs_is_known_by_its_lines_whatever_its_name() {
    let folder = Folder::new();
    let mut list = "# made by associate.py\n".to_owned();
    for k in 0..3 {
        folder.depth(&format!("depth/{k}.png"), 1500);
        folder.colour(&format!("rgb/{k}.png"), SIZE, 90);
        list.push_str(&format!("{k}.25 rgb/{k}.png {k}.26 depth/{k}.png\n"));
    }
    folder.write("camera.toml", CAMERA);
    folder.write("notes.txt", "four words and more\nfour words depth/1.png there\n");
    folder.write("rgbd_assoc.txt", &list);
    let source = folder.open();
    assert_eq!(stamps(&source), [250_000_000, 1_250_000_000, 2_250_000_000]);
    assert_eq!((described(&source, "list"), source.pairing().n_pairs), ("rgbd_assoc.txt".to_owned(), 3));
}

#[test]
fn depth_as_3rscan_has_it_is_read() {
    let folder = Folder::new();
    let values: Vec<u8> = (0..SIZE.0 * SIZE.1).flat_map(|_| 1500_u16.to_be_bytes()).collect();
    let pgm = [format!("P5\n{} {}\n65535\n", SIZE.0, SIZE.1).into_bytes(), values].concat();
    for k in 0..3 {
        folder.write(&format!("frame-{k:06}.depth.pgm"), &pgm);
    }
    let camera = "30 0 15.5 0 0 30 11.5 0 0 0 1 0 0 0 0 1";
    folder.write(
        "_info.txt",
        format!("m_depthWidth = {}\nm_depthHeight = {}\nm_depthShift = 1000.000000\nm_calibrationDepthIntrinsic = {camera}\n", SIZE.0, SIZE.1),
    );
    let source = folder.open();
    assert_eq!((source.camera().fx, source.camera().units_per_metre), (30.0, 1000.0));
    assert_eq!((source.n_frames(), read(&source, 1).0), (Some(3), 1500));
}

#[test]
fn lists_that_were_swapped_say_what_the_image_is() {
    let folder = Folder::new();
    folder.write("rgb/0.jpg", [0xff, 0xd8, 0xff, 0xe0, 0, 16]);
    folder.write("depth.txt", "1.5 rgb/0.jpg\n");
    folder.write("camera.toml", CAMERA);
    let source = folder.open();
    let (mut depth, mut colour) = (vec![9; 768], vec![9; 3 * 768]);
    let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
    let words = source.read(0, &mut buffers).unwrap_err().to_string();
    assert!(
        words.contains(
            "rgb/0.jpg: found a JPEG (is it a colour image?), expected a PNG, TIFF, PGM, NPY or OpenEXR of depth"
        ),
        "{words}"
    );
}

/// One frame for each depth image, of the size of depth.
#[test]
fn a_video_beside_depth_is_its_colour_where_they_are_as_many() {
    let folder = Folder::new();
    if video(folder.path(), 5).is_none() {
        return;
    }
    folder.write("camera.toml", CAMERA.replace("32", "64").replace("24", "48"));
    (0..4).for_each(|k| folder.depth_of(&format!("depth/{k}.png"), (64, 48), 1500));
    let warnings = folder.open().warnings().join("\n");
    let expected = "it is a video (rgb.mp4): has 5 frames, expected one for each of 4 depth images";
    assert!(warnings.contains(expected), "{warnings}");
    folder.depth_of("depth/4.png", (64, 48), 1500);
    let source = folder.open();
    assert_eq!((source.warnings(), source.pairing().n_pairs), (&[][..], 5));
    assert!(described(&source, "video").starts_with("rgb.mp4, a frame for each depth image"));
    let frames = [0, 1].map(|index| read(&source, index));
    assert!(frames.iter().all(|frame| frame.1) && frames[0].2 != frames[1].2, "{frames:?}");
    folder.write("rgb.mp4", "no video");
    let warnings = folder.open().warnings().join("\n");
    assert!(warnings.contains("no frame has colour: it is a video (rgb.mp4): "), "{warnings}");
}
