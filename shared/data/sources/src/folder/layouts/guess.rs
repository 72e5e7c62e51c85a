//! A camera guessed by the size of its depth images, for a first look; and a template to fill in.

use super::asked::ChosenCamera;
use super::files::size_of;
use crate::SourceError;
use crate::folder::list::ListEntry;
use std::path::Path;
use tessera_frames::{decode, large};
use tessera_geometry::Camera;

/// Columns, rows, focal length in pixels, and the cameras that have them.
const DEVICES: [(u32, u32, f64, &str); 13] = [
    (640, 480, 570.0, "a Kinect, PrimeSense or Astra"),
    (320, 240, 285.0, "a Kinect, PrimeSense or Astra"),
    (512, 424, 365.0, "a Kinect 2"),
    (640, 576, 504.0, "an Azure Kinect, narrow view"),
    (320, 288, 252.0, "an Azure Kinect, narrow view binned"),
    (512, 512, 252.0, "an Azure Kinect, wide view binned"),
    (1024, 1024, 504.0, "an Azure Kinect, wide view"),
    (1280, 720, 640.0, "a RealSense D400"),
    (848, 480, 425.0, "a RealSense D400"),
    (640, 360, 320.0, "a RealSense D400"),
    (1024, 768, 730.0, "a RealSense L515"),
    (256, 192, 212.0, "an iPhone or iPad with LiDAR"),
    (192, 256, 212.0, "an iPhone or iPad with LiDAR"),
];
/// Focal length as a share of the longer side, of any other camera: about 58 degrees.
const USUAL_FOCAL: f64 = 0.9;
/// Depth units of cameras and data sets, a metre, and the median depth of most recordings, metres.
const USUAL_UNITS: [f64; 4] = [1000.0, 5000.0, 10_000.0, 256.0];
const TYPICAL_M: f64 = 1.5;

/// A camera for images of a size.
fn of_size((width, height): (u32, u32), units: f64) -> (Camera, &'static str) {
    let known = DEVICES.iter().find(|device| (device.0, device.1) == (width, height));
    let other = USUAL_FOCAL * f64::from(width.max(height));
    let (focal, device) =
        known.map_or((other, "a camera with a view of 58 degrees"), |known| (known.2, known.3));
    let middle = |side: u32| (f64::from(side) - 1.0) / 2.0;
    (Camera::pinhole((width, height), [focal, focal, middle(width), middle(height)], units), device)
}

/// Units that bring the median of the first image that can be read nearest to what is usual.
fn units_of(folder: &Path, depth: &[ListEntry], size: (u32, u32), units: f64) -> f64 {
    let mut raw = vec![0; (size.0 as usize).saturating_mul(size.1 as usize)];
    let mut read = |entry: &ListEntry| {
        let bytes = std::fs::read(folder.join(&entry.file)).ok()?;
        decode::depth_in(&bytes, size, units, &mut raw).ok()?;
        let mut measured: Vec<u16> =
            raw.iter().copied().filter(|raw| *raw != 0 && *raw != u16::MAX).collect();
        measured.sort_unstable();
        measured.get(measured.len() / 2).copied()
    };
    let Some(median) = depth.iter().take(5).find_map(&mut read) else { return units };
    let off = |units: f64| {
        let median_m = f64::from(median) / units / TYPICAL_M;
        median_m.max(1.0 / median_m)
    };
    USUAL_UNITS.into_iter().min_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(units)
}

/// The guess, which is doubted in every verdict.
pub(super) fn camera(folder: &Path, depth: &[ListEntry], units: f64) -> Result<ChosenCamera, SourceError> {
    let size = size_of(folder, depth)?;
    let (camera, device) = of_size(size, units_of(folder, depth, size, units));
    large::check_camera(&camera)
        .map_err(|source| SourceError::CameraValue { file: "the guessed camera".to_owned(), source })?;
    let from = format!("a guess by the size of the images: {device}");
    let doubt = format!(
        "the camera is {from} (fx = {}, units_per_metre = {}): lengths and shapes may be wrong by a tenth or more; \
         tessera calibrate FOLDER --camera guess --out camera.toml improves it",
        camera.fx, camera.units_per_metre
    );
    Ok(ChosenCamera { doubts: vec![doubt], ..ChosenCamera::stated(camera, from) })
}

/// A camera file to fill in, in one line; empty where no depth image can be read.
pub(super) fn template(folder: &Path, depth: &[ListEntry], units: f64) -> String {
    let Ok(size) = size_of(folder, depth) else { return String::new() };
    let (camera, _) = of_size(size, units_of(folder, depth, size, units));
    let Camera { width, height, fx, fy, cx, cy, units_per_metre, .. } = camera;
    format!(
        "; a camera.toml holds lines as: width = {width}, height = {height}, fx = {fx}, fy = {fy}, cx = {cx}, cy = {cy}, \
         units_per_metre = {units_per_metre} (a guess: --camera guess runs with it)"
    )
}
