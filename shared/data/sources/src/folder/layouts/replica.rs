//! Replica as rendered for iMAP and NICE-SLAM: `results/frame000000.jpg`, `results/depth000000.png`,
//! `traj.txt` with a camera-to-world matrix a line, `cam_params.json` here or in the folder above.

use super::asked::ChosenCamera;
use super::files::{json, numbered, pinhole, some_depth, wrong};
use super::times::FrameTimes;
use super::{Asked, FoundLayout, pose};
use crate::SourceError;
use serde::Deserialize;
use std::path::Path;

pub(super) const NAME: &str = "Replica (results/, traj.txt)";

const IMAGES: &str = "results";
const CAMERA: &str = "cam_params.json";

/// `cam_params.json`.
#[derive(Deserialize)]
struct CamParams {
    camera: Params,
}

/// Size in pixels, intrinsics, units of depth a metre.
#[derive(Deserialize)]
struct Params {
    w: u32,
    h: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    scale: f64,
}

pub(super) fn is(folder: &Path) -> bool {
    folder.join(IMAGES).is_dir() && !numbered(folder, IMAGES, "depth", &[".png"]).is_empty()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let images = numbered(folder, IMAGES, "depth", &[".png"]);
    let times = FrameTimes::of(&images, asked, None, folder)?;
    let depth = some_depth(times.entries(&images), folder, "results/depthNUMBER.png")?;
    let colour = times.entries(&numbered(folder, IMAGES, "frame", &[".jpg", ".png"]));
    let camera = asked.camera(folder, || {
        let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
        let above = absolute.parent().unwrap_or(&absolute).join(CAMERA);
        let Some(file) = [folder.join(CAMERA), above].into_iter().find(|file| file.is_file()) else {
            return Err(wrong(
                folder,
                "no cam_params.json here or in the folder above; put it there, or give --camera FILE",
            ));
        };
        let Params { w, h, fx, fy, cx, cy, scale } = json::<CamParams>(&file)?.camera;
        Ok(ChosenCamera::stated(pinhole((w, h), [fx, fy, cx, cy], scale, &file)?, CAMERA))
    })?;
    let mut found = FoundLayout::new(NAME, camera, depth, colour);
    let trajectory = folder.join("traj.txt");
    if trajectory.is_file() {
        let stamps: Vec<i64> = found.depth.iter().map(|entry| entry.stamp_nanos).collect();
        found.take_truth(pose::of_lines(&trajectory, &stamps));
    }
    found.notes.push(("times", times.words));
    Ok(found)
}
