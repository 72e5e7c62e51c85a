//! A camera that is unlike one that took images of its size.

use tessera_geometry::Camera;

/// Angles of view that depth cameras have, degrees.
const USUAL_VIEW_DEG: std::ops::RangeInclusive<f64> = 25.0..=130.0;
/// Share of a side by which the principal point of a camera is off the middle at most: those of eight
/// public data sets are within 0.06.
const MOST_OFF: f64 = 0.1;
/// Sides of a pixel.
const USUAL_RATIO: std::ops::RangeInclusive<f64> = 0.8..=1.25;

/// What looks wrong with a camera, in sentences.
pub fn odd_camera(camera: &Camera) -> Vec<String> {
    let mut found = Vec::new();
    for (name, degrees) in ["horizontal", "vertical"].into_iter().zip(fields_of_view_deg(camera)) {
        if !USUAL_VIEW_DEG.contains(&degrees) {
            found.push(format!(
                "{name} field of view is {degrees:.1} degrees: do focal length and image size belong together?"
            ));
        }
    }
    let off = |centre: f64, side: u32| (centre / f64::from(side) - 0.5).abs() > MOST_OFF;
    let Camera { width, height, cx, cy, .. } = *camera;
    if off(cx, width) || off(cy, height) {
        let is_swapped = !off(cy, width) && !off(cx, height);
        let hint =
            if is_swapped { ": are cx and cy swapped?" } else { ": is it the camera of these images?" };
        found.push(format!(
            "the principal point is {cx}, {cy}, far from the middle of {width}x{height} px{hint}"
        ));
    }
    let ratio = (camera.fx / camera.fy).abs();
    if !USUAL_RATIO.contains(&ratio) {
        found.push(format!("fx / fy is {ratio:.2}: pixels are rarely that oblong"));
    }
    found
}

/// Field of view from the first to the last column, and from the first to the last row, degrees.
pub(crate) fn fields_of_view_deg(camera: &Camera) -> [f64; 2] {
    let (row, column) = ((f64::from(camera.height) - 1.0) / 2.0, (f64::from(camera.width) - 1.0) / 2.0);
    let angle = |from: (f64, f64), to: (f64, f64)| {
        let (a, b) = (camera.ray(from.0, from.1), camera.ray(to.0, to.1));
        libm::atan2(a.cross(&b).norm(), a.dot(&b)) * 180.0 / std::f64::consts::PI
    };
    [angle((row, 0.0), (row, 2.0 * column)), angle((0.0, column), (2.0 * row, column))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_of_other_images_is_named() {
        let words = |size, numbers| odd_camera(&Camera::pinhole(size, numbers, 1000.0)).join("\n");
        assert_eq!(words((640, 480), [525.0, 525.0, 319.5, 255.3]), "");
        assert_eq!(words((640, 480), [480.0, -480.0, 319.5, 239.5]), "", "ICL-NUIM");
        assert!(words((640, 480), [525.0, 525.0, 239.5, 319.5]).contains("cx and cy swapped?"));
        assert!(
            words((640, 480), [525.0, 525.0, 319.5, 120.0]).contains("is it the camera of these images?")
        );
        assert!(words((640, 480), [50.0, 50.0, 319.5, 239.5]).contains("horizontal field of view is 162"));
        assert!(words((640, 480), [525.0, 262.0, 319.5, 239.5]).contains("fx / fy is 2.00"));
    }
}
