//! The room as a camera of the network sees it: its images, their times, and where the camera was.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde_json::json;
use std::path::Path;
use tessera_sources::{FrameBuffers, SourceOptions, SourceSpec};

const CAMERA: &str = "width = 160\nheight = 120\nfx = 131.25\nfy = 131.25\ncx = 79.5\ncy = 59.5\n\
                      units_per_metre = 1000.0\n";
/// Images that a camera plays to and fro.
const N_IMAGES: u64 = 30;
/// Begin of the images' time, nanoseconds: not that of all time, where a clock that jumps back would meet zero.
const EPOCH_NANOS: i64 = 1_700_000_000_000_000_000;

/// Writes images of the room, raw, and what `camera.py` needs to know of them.
pub(crate) fn room(folder: &Path) {
    let camera = folder.join("camera.toml");
    std::fs::write(&camera, CAMERA).unwrap();
    let options = SourceOptions { camera: Some(camera.display().to_string()), ..room_options() };
    let source = tessera_sources::open(&SourceSpec::parse("room"), &options).unwrap();
    let of = source.camera().clone();
    let n_pixels = of.width as usize * of.height as usize;
    let (mut depth, mut colour) = (vec![0u16; n_pixels], vec![0u8; 3 * n_pixels]);
    let mut stamps = Vec::new();
    for index in 0..N_IMAGES {
        let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
        stamps.push(source.read(index, &mut buffers).unwrap().stamp_nanos + EPOCH_NANOS);
        let raw: Vec<u8> = depth.iter().flat_map(|value| value.to_le_bytes()).collect();
        std::fs::write(folder.join(format!("d{index}.raw")), raw).unwrap();
        std::fs::write(folder.join(format!("c{index}.raw")), &colour).unwrap();
    }
    let described = json!({
        "width": of.width, "height": of.height, "fx": of.fx, "fy": of.fy, "cx": of.cx, "cy": of.cy,
        "n": N_IMAGES, "stamps": stamps,
    });
    std::fs::write(folder.join("camera.json"), described.to_string()).unwrap();
}

fn room_options() -> SourceOptions {
    SourceOptions { frames: Some(N_IMAGES), ..SourceOptions::default() }
}

/// Stamps of the images of [`room`], nanoseconds, and where its camera was, `world_from_camera`.
pub(crate) fn room_poses() -> (Vec<i64>, Vec<Isometry3<f64>>) {
    let source = tessera_sources::open(&SourceSpec::parse("room"), &room_options()).unwrap();
    let truth = source.ground_truth().unwrap();
    (truth.stamps_nanos.iter().map(|stamp| stamp + EPOCH_NANOS).collect(), truth.poses.clone())
}

/// A pose from translation and quaternion `x y z w`.
pub(crate) fn pose(numbers: &[f64]) -> Isometry3<f64> {
    let [x, y, z, qx, qy, qz, qw] = *numbers else { panic!("{numbers:?}") };
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(qw, qx, qy, qz));
    Isometry3::from_parts(Translation3::new(x, y, z), rotation)
}

/// Where `camera.py` says on `/tf_static` that the camera is.
pub(crate) fn base_from_camera() -> Isometry3<f64> {
    pose(&[0.2, 0.0, 1.0, -0.5, 0.5, -0.5, 0.5])
}
