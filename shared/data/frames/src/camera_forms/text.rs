//! Plain text: COLMAP's `cameras.txt`, BundleFusion's `info.txt`, ScanNet's, a 3x3 or 4x4 matrix, and
//! `fx fy cx cy` as of ETH3D.

use super::{StatedCamera, side};
use crate::OtherLens;

pub(super) fn parse(text: &str) -> Result<Option<StatedCamera>, String> {
    let lines: Vec<&str> =
        text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#')).collect();
    if lines.iter().any(|line| line.split_once('=').is_some()) {
        return bundle_fusion(&lines);
    }
    match colmap(&lines)? {
        Some(stated) => Ok(Some(stated)),
        None => Ok(matrix(&lines)),
    }
}

/// `key = value`: `m_depthWidth`, `m_calibrationDepthIntrinsic`, `m_depthShift`; `fx_depth` as of ScanNet.
fn bundle_fusion(lines: &[&str]) -> Result<Option<StatedCamera>, String> {
    // All words of a value are numbers, or none is used: one that is left out would shift the others.
    let values = |key: &str| -> Vec<f64> {
        let found =
            lines.iter().filter_map(|line| line.split_once('=')).find(|(known, _)| known.trim() == key);
        let numbers = found.map(|(_, value)| value.split_whitespace().map(str::parse).collect());
        numbers.and_then(Result::ok).unwrap_or_default()
    };
    let one = |key: &str| values(key).first().copied();
    let named = [["m_depthWidth", "m_depthHeight"], ["depthWidth", "depthHeight"]];
    let size = named.iter().find_map(|[width, height]| {
        let (width, height) = (one(width)?, one(height)?);
        Some((side(width)?, side(height)?))
    });
    let intrinsics = match values("m_calibrationDepthIntrinsic")[..] {
        [fx, _, cx, _, _, fy, cy, _, 0.0, 0.0, 1.0, _, 0.0, 0.0, 0.0, 1.0] => [fx, fy, cx, cy],
        _ => match ["fx_depth", "fy_depth", "mx_depth", "my_depth"].map(one) {
            [Some(fx), Some(fy), Some(cx), Some(cy)] => [fx, fy, cx, cy],
            _ => return Ok(None),
        },
    };
    let units_per_metre = one("m_depthShift").map_or(Ok(None), super::units_of_scale)?;
    Ok(Some(StatedCamera { form: "info.txt", size, intrinsics, units_per_metre, ..StatedCamera::default() }))
}

/// `CAMERA_ID MODEL WIDTH HEIGHT PARAMS`; there the middle of the first pixel is at 0.5.
fn colmap(lines: &[&str]) -> Result<Option<StatedCamera>, String> {
    let Some(words) = lines.first().map(|line| line.split_whitespace().collect::<Vec<&str>>()) else {
        return Ok(None);
    };
    let [id, model, width, height, params @ ..] = words.as_slice() else { return Ok(None) };
    let (Ok(_), Ok(width), Ok(height)) = (id.parse::<u64>(), width.parse::<u32>(), height.parse::<u32>())
    else {
        return Ok(None);
    };
    if model.is_empty() || !model.chars().all(|c| c.is_ascii_uppercase() || c == '_') {
        return Ok(None);
    }
    let params: Vec<f64> = params.iter().map(|word| word.parse().unwrap_or(f64::NAN)).collect();
    let plain = |f: [f64; 4], [k1, k2, p1, p2]: [f64; 4]| (f, [k1, k2, p1, p2, 0.0], None);
    let fisheye = |f: [f64; 4], k: [f64; 4]| (f, [0.0; 5], Some(OtherLens::Equidistant(k)));
    let ([fx, fy, cx, cy], distortion, lens) = match (*model, params.as_slice()) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => plain([f, f, cx, cy], [0.0; 4]),
        ("PINHOLE", &[fx, fy, cx, cy]) => plain([fx, fy, cx, cy], [0.0; 4]),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => plain([f, f, cx, cy], [k, 0.0, 0.0, 0.0]),
        ("RADIAL", &[f, cx, cy, k1, k2]) => plain([f, f, cx, cy], [k1, k2, 0.0, 0.0]),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => plain([fx, fy, cx, cy], [k1, k2, p1, p2]),
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            let lens = OtherLens::Rational([k1, k2, p1, p2, k3, k4, k5, k6]);
            ([fx, fy, cx, cy], [0.0; 5], Some(lens))
        }
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => fisheye([f, f, cx, cy], [k, 0.0, 0.0, 0.0]),
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => fisheye([f, f, cx, cy], [k1, k2, 0.0, 0.0]),
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => fisheye([fx, fy, cx, cy], [k1, k2, k3, k4]),
        _ => {
            return Err(format!(
                "camera model {model} with {} parameters, expected a pinhole, radial, OpenCV or fisheye model of COLMAP",
                params.len()
            ));
        }
    };
    if lines.len() > 1 {
        return Err(format!("{} cameras, expected one", lines.len()));
    }
    Ok(Some(StatedCamera {
        form: "COLMAP cameras.txt",
        size: Some((width, height)),
        intrinsics: [fx, fy, cx - 0.5, cy - 0.5],
        distortion,
        lens,
        ..StatedCamera::default()
    }))
}

/// Nothing but numbers: a 3x3 or 4x4 matrix, or `fx fy cx cy`.
fn matrix(lines: &[&str]) -> Option<StatedCamera> {
    let separates = |c: char| c.is_whitespace() || [',', '[', ']', ';'].contains(&c);
    let words = lines.iter().flat_map(|line| line.split(separates)).filter(|word| !word.is_empty());
    let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
    let intrinsics = match numbers?[..] {
        [fx, _, cx, _, fy, cy, 0.0, 0.0, 1.0] => [fx, fy, cx, cy],
        [fx, _, cx, _, _, fy, cy, _, 0.0, 0.0, 1.0, _, 0.0, 0.0, 0.0, 1.0] => [fx, fy, cx, cy],
        [fx, fy, cx, cy] => [fx, fy, cx, cy],
        _ => return None,
    };
    // A pose is a 4x4 matrix too.
    let is_focal = intrinsics[0].abs() > 16.0 && intrinsics[1].abs() > 16.0;
    is_focal.then(|| StatedCamera { form: "matrix", intrinsics, ..StatedCamera::default() })
}
