//! YAML: ROS's camera_info, ORB-SLAM's and OpenCV's settings, Kalibr's camchain.
//!
//! Of YAML it takes `key: value` and lists of numbers, wherever they stand; that is all these files use.

use super::{StatedCamera, side, units_of_scale};
use crate::{OtherLens, SentWindow, StatedLens};

/// `key: value` of a text, with the lists of numbers that follow a key.
struct Keys<'a>(Vec<(&'a str, String)>);

impl<'a> Keys<'a> {
    fn of(text: &'a str) -> Self {
        let mut keys: Vec<(&str, String)> = Vec::new();
        for line in text.lines() {
            let line = line.split(" #").next().unwrap_or_default();
            let inner = line.trim().trim_start_matches("- ");
            if inner.starts_with(['#', '%']) || inner == "---" {
                continue;
            }
            match inner.split_once(':') {
                Some((key, value)) if !key.trim().is_empty() && !key.contains('[') => {
                    keys.push((key.trim().trim_matches(['"', '\'']), value.trim().to_owned()));
                }
                // A list that goes on, in brackets or item by item.
                _ => {
                    if let Some((_, value)) = keys.last_mut() {
                        value.push(' ');
                        value.push_str(inner);
                    }
                }
            }
        }
        Self(keys)
    }

    fn text(&self, key: &str) -> Option<&str> {
        let found = self.0.iter().find(|(known, _)| known.eq_ignore_ascii_case(key));
        found.map(|(_, value)| value.trim_matches(['"', '\'', ' ']))
    }

    fn number(&self, key: &str) -> Option<f64> {
        self.text(key)?.parse().ok()
    }

    fn numbers(&self, key: &str) -> Vec<f64> {
        numbers(self.text(key).unwrap_or_default())
    }

    /// A whole number of `key`, inside `table` if one is named; 0 where there is none.
    fn whole(&self, table: Option<&str>, key: &str) -> Result<u32, String> {
        let known = |name: &str| self.0.iter().position(|(known, _)| known.eq_ignore_ascii_case(name));
        let Some(begin) = table.map_or(Some(0), known) else { return Ok(0) };
        let inside = self.0.get(begin..).unwrap_or_default();
        match inside.iter().find(|(known, _)| known.eq_ignore_ascii_case(key)) {
            None => Ok(0),
            Some((_, value)) => {
                let words = || format!("{key} is '{value}', expected a whole number of pixels");
                value.parse().map_err(|_| words())
            }
        }
    }

    /// The numbers of `data` inside the table `key`.
    fn data(&self, key: &str) -> Vec<f64> {
        let at = self.0.iter().position(|(known, _)| known.eq_ignore_ascii_case(key));
        let inside = at.and_then(|at| self.0.get(at..)).unwrap_or_default();
        let data = inside.iter().take(6).skip(1).find(|(known, _)| known.eq_ignore_ascii_case("data"));
        match inside.first().map(|(_, value)| numbers(value)).filter(|own| own.len() > 3) {
            Some(own) => own,
            None => data.map_or(Vec::new(), |(_, value)| numbers(value)),
        }
    }
}

/// The numbers of a list; none where a word of it is no number, which would shift the others.
fn numbers(text: &str) -> Vec<f64> {
    let separates = |c: char| c.is_whitespace() || ['[', ']', ',', ';'].contains(&c);
    let words = text.split(separates).filter(|word| !word.is_empty() && *word != "-");
    words.map(|word| word.parse().ok()).collect::<Option<Vec<f64>>>().unwrap_or_default()
}

pub(super) fn parse(text: &str) -> Result<Option<StatedCamera>, String> {
    let keys = Keys::of(text);
    match ros(&keys)? {
        Some(stated) => Ok(Some(stated)),
        None => match orb_slam(&keys)? {
            Some(stated) => Ok(Some(stated)),
            None => kalibr(&keys),
        },
    }
}

/// `camera_matrix`, `image_width`, or a CameraInfo as `ros2 topic echo` prints it; of a rectified image the
/// projection has the same numbers.
fn ros(keys: &Keys<'_>) -> Result<Option<StatedCamera>, String> {
    let is_echo = keys.text("camera_matrix").is_none();
    let [matrix, coefficients, width, height] = match is_echo {
        true => ["k", "d", "width", "height"],
        false => ["camera_matrix", "distortion_coefficients", "image_width", "image_height"],
    };
    let numbers = |key| if is_echo { keys.numbers(key) } else { keys.data(key) };
    let [fx, _, cx, _, fy, cy, 0.0, 0.0, 1.0] = numbers(matrix)[..] else { return Ok(None) };
    let model = keys.text("distortion_model").filter(|model| !model.is_empty()).unwrap_or("plumb_bob");
    let (distortion, lens) = distortion(model, &numbers(coefficients))?;
    let region = |key| keys.whole(Some("roi"), key);
    let window = SentWindow {
        binning: [keys.whole(None, "binning_x")?, keys.whole(None, "binning_y")?],
        first: [region("x_offset")?, region("y_offset")?],
        size: [region("width")?, region("height")?],
    };
    let intrinsics = [fx, fy, cx, cy];
    let (size, intrinsics) = match size(keys.number(width), keys.number(height)) {
        Some(whole) => {
            let (size, intrinsics) = window.of(whole, intrinsics);
            (Some(size), intrinsics)
        }
        None => (None, intrinsics),
    };
    Ok(Some(StatedCamera {
        form: "ROS camera_info",
        size,
        intrinsics,
        distortion,
        lens,
        units_per_metre: None,
        fps: None,
    }))
}

/// `Camera.fx`, in newer versions `Camera1.fx`.
fn orb_slam(keys: &Keys<'_>) -> Result<Option<StatedCamera>, String> {
    let value = |name: &str| {
        keys.number(&format!("Camera.{name}")).or_else(|| keys.number(&format!("Camera1.{name}")))
    };
    let Some([fx, fy, cx, cy]) = four(["fx", "fy", "cx", "cy"].map(value)) else { return Ok(None) };
    let is_fisheye =
        keys.text("Camera.type").is_some_and(|model| model.eq_ignore_ascii_case("KannalaBrandt8"));
    let (model, names) = match is_fisheye {
        true => ("equidistant", &["k1", "k2", "k3", "k4"][..]),
        false => ("plumb_bob", &["k1", "k2", "p1", "p2", "k3"][..]),
    };
    let coefficients: Vec<f64> = names.iter().map(|name| value(name).unwrap_or(0.0)).collect();
    let (distortion, lens) = distortion(model, &coefficients)?;
    let factor = keys.number("DepthMapFactor").or_else(|| keys.number("RGBD.DepthMapFactor"));
    Ok(Some(StatedCamera {
        form: "ORB-SLAM settings",
        size: size(keys.number("Camera.width"), keys.number("Camera.height")),
        intrinsics: [fx, fy, cx, cy],
        distortion,
        lens,
        units_per_metre: factor.map_or(Ok(None), units_of_scale)?,
        fps: keys.number("Camera.fps").filter(|fps| *fps > 0.0),
    }))
}

/// `intrinsics: [fx, fy, cx, cy]`, `resolution: [w, h]`.
fn kalibr(keys: &Keys<'_>) -> Result<Option<StatedCamera>, String> {
    let [fx, fy, cx, cy] = keys.numbers("intrinsics")[..] else { return Ok(None) };
    let size = match keys.numbers("resolution")[..] {
        [width, height] => size(Some(width), Some(height)),
        _ => None,
    };
    if let Some(other) = keys.text("camera_model").filter(|model| *model != "pinhole") {
        return Err(format!("camera model '{other}', expected pinhole (with radtan or equidistant)"));
    }
    let model = keys.text("distortion_model").unwrap_or("radtan");
    let (distortion, lens) = distortion(model, &keys.numbers("distortion_coeffs"))?;
    Ok(Some(StatedCamera {
        form: "Kalibr camchain",
        size,
        intrinsics: [fx, fy, cx, cy],
        distortion,
        lens,
        ..StatedCamera::default()
    }))
}

fn four(values: [Option<f64>; 4]) -> Option<[f64; 4]> {
    let [Some(a), Some(b), Some(c), Some(d)] = values else { return None };
    Some([a, b, c, d])
}

fn size(width: Option<f64>, height: Option<f64>) -> Option<(u32, u32)> {
    Some((side(width?)?, side(height?)?))
}

/// Five coefficients of Brown and Conrady, and a lens that these do not describe.
///
/// # Errors
/// Another model that distorts.
fn distortion(model: &str, coefficients: &[f64]) -> Result<([f64; 5], Option<OtherLens>), String> {
    match StatedLens::of_model(model, coefficients) {
        Some(StatedLens::Plain(five)) => Ok((five, None)),
        Some(StatedLens::Other(lens)) => Ok(([0.0; 5], Some(lens))),
        None => Err(format!(
            "distortion model '{model}' with coefficients {coefficients:?}, expected plumb_bob with up to 5, rational_polynomial with 8 or equidistant with 4: rectify the images first"
        )),
    }
}
