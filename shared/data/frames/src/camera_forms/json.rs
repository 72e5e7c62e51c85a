//! JSON: Open3D, Replica's `cam_params.json`, nerfstudio's `transforms.json`, and plain `fx fy cx cy`.

use super::{StatedCamera, units_of_scale};
use crate::{OtherLens, StatedLens};
use serde_json::{Map, Value};

/// Names of a value in different programs, in small letters.
const WIDTH: &[&str] = &["width", "w", "image_width"];
const HEIGHT: &[&str] = &["height", "h", "image_height"];
const FOCAL: [&[&str]; 4] = [
    &["fx", "fl_x", "focal_x"],
    &["fy", "fl_y", "focal_y"],
    &["cx", "ppx", "principal_x"],
    &["cy", "ppy", "principal_y"],
];
const MATRIX: &[&str] = &["intrinsic_matrix", "k", "camera_matrix", "intrinsics", "intrinsic"];
const SCALE: &[&str] = &[
    "depth_scale",
    "units_per_metre",
    "png_depth_scale",
    "depth_unit_scale_factor",
    "integer_depth_scale",
    "depth_factor",
    "depth_map_factor",
    "depthmapfactor",
    "depth_scaling_factor",
];
/// A key that is only named `scale` is one of depth from here on.
const LEAST_PLAIN_SCALE: f64 = 100.0;
/// Model of the lens.
const MODEL: &[&str] = &["camera_model", "distortion_model", "model"];
/// Its coefficients as a list.
const COEFFICIENTS: &[&str] = &["coeffs", "distortion", "distortion_coefficients", "dist_coeffs", "dist"];
const FPS: &[&str] = &["fps", "frame_rate"];
/// Tables that hold a camera.
const INSIDE: &[&str] = &["camera", "intrinsics", "intrinsic", "depth", "depth_intrinsics", "camera_params"];

pub(super) fn parse(text: &str) -> Result<Option<StatedCamera>, String> {
    let Ok(Value::Object(all)) = serde_json::from_str::<Value>(text) else { return Ok(None) };
    let inside = INSIDE.iter().filter_map(|name| get(&all, &[name])?.as_object());
    for table in std::iter::once(&all).chain(inside) {
        let Some(intrinsics) = intrinsics(table) else { continue };
        // What the table does not state may stand beside it.
        let number = |names: &[&str]| get(table, names).or_else(|| get(&all, names)).and_then(number);
        let is_nerf = get(table, &["fl_x"]).is_some();
        let [fx, fy, cx, cy] = intrinsics;
        // There the middle of the first pixel is at 0.5.
        let half = if is_nerf { 0.5 } else { 0.0 };
        let side = |names| number(names).and_then(super::side);
        let value = |name: &str| number(&[name]).unwrap_or(0.0);
        let model =
            get(table, MODEL).or_else(|| get(&all, MODEL)).and_then(Value::as_str).unwrap_or_default();
        let list = get(table, COEFFICIENTS).or_else(|| get(&all, COEFFICIENTS)).and_then(Value::as_array);
        let (distortion, lens) = match (list, model.contains("FISHEYE")) {
            (Some(list), _) => listed_lens(model, list)?,
            (None, true) => ([0.0; 5], Some(OtherLens::Equidistant(["k1", "k2", "k3", "k4"].map(value)))),
            (None, false) => (["k1", "k2", "p1", "p2", "k3"].map(value), None),
        };
        return Ok(Some(StatedCamera {
            form: if is_nerf { "nerfstudio" } else { "JSON" },
            size: side(WIDTH).zip(side(HEIGHT)),
            intrinsics: [fx, fy, cx - half, cy - half],
            distortion,
            lens,
            units_per_metre: scale(table, &all)?,
            fps: number(FPS).filter(|fps| *fps > 0.0),
        }));
    }
    Ok(None)
}

/// A lens by the name of its model, as `distortion.brown_conrady` of librealsense, and a list of coefficients.
///
/// # Errors
/// Another model that distorts, or a list of other things than numbers.
fn listed_lens(model: &str, list: &[Value]) -> Result<([f64; 5], Option<OtherLens>), String> {
    let name = model.rsplit('.').next().unwrap_or_default().to_lowercase();
    let name = if name.contains("pinhole") || name == "opencv" { "" } else { &name };
    let coefficients: Option<Vec<f64>> = list.iter().map(number).collect();
    match coefficients.as_deref().and_then(|coefficients| StatedLens::of_model(name, coefficients)) {
        Some(StatedLens::Plain(five)) => Ok((five, None)),
        Some(StatedLens::Other(lens)) => Ok(([0.0; 5], Some(lens))),
        None => Err(format!(
            "distortion model '{model}' with coefficients {}, expected brown_conrady with up to 5, rational_polynomial with 8 or equidistant with 4: rectify the images first",
            serde_json::Value::from(list.to_vec())
        )),
    }
}

/// The depth scale of a file, which may have no camera.
pub(crate) fn scale_alone(text: &str) -> Result<Option<f64>, String> {
    let Ok(Value::Object(all)) = serde_json::from_str::<Value>(text) else { return Ok(None) };
    scale(&all, &all)
}

fn scale(table: &Map<String, Value>, all: &Map<String, Value>) -> Result<Option<f64>, String> {
    let found = get(table, SCALE).or_else(|| get(all, SCALE)).and_then(number);
    // A plain `scale` may be anything, unless it is as large as Replica's 6553.5.
    let plain = get(table, &["scale"]).and_then(number).filter(|scale| *scale >= LEAST_PLAIN_SCALE);
    found.or(plain).map_or(Ok(None), units_of_scale)
}

/// `fx fy cx cy` by name, or of a matrix: nine numbers by columns, as Open3D writes them, or by rows,
/// told apart by where the principal point is.
fn intrinsics(table: &Map<String, Value>) -> Option<[f64; 4]> {
    let named: Option<Vec<f64>> = FOCAL.iter().map(|names| get(table, names).and_then(number)).collect();
    if let Some([fx, fy, cx, cy]) = named.as_deref() {
        return Some([*fx, *fy, *cx, *cy]);
    }
    let mut numbers = Vec::new();
    flatten(get(table, MATRIX)?, &mut numbers);
    match numbers[..] {
        [fx, _, cx, _, fy, cy, 0.0, 0.0, _] => Some([fx, fy, cx, cy]),
        [fx, _, 0.0, _, fy, 0.0, cx, cy, _] => Some([fx, fy, cx, cy]),
        [fx, fy, cx, cy] => Some([fx, fy, cx, cy]),
        _ => None,
    }
}

fn flatten(value: &Value, numbers: &mut Vec<f64>) {
    match value {
        Value::Array(values) => values.iter().for_each(|value| flatten(value, numbers)),
        value => numbers.extend(value.as_f64()),
    }
}

fn number(value: &Value) -> Option<f64> {
    value.as_f64().or_else(|| value.as_str()?.parse().ok())
}

fn get<'a>(table: &'a Map<String, Value>, names: &[&str]) -> Option<&'a Value> {
    names
        .iter()
        .find_map(|name| table.iter().find(|(key, _)| key.to_lowercase() == **name))
        .map(|(_, value)| value)
}
