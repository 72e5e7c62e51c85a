//! The camera model: a pinhole with optional Brown-Conrady distortion and rolling shutter.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Error of a camera description.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// An image side is out of range.
    #[error("image size is {width}x{height} px, expected 16x16 to 1920x1080, either way up")]
    Size {
        /// Columns found.
        width: u32,
        /// Rows found.
        height: u32,
    },
    /// A focal length is zero or not a number.
    #[error(
        "focal length {name} is {value}, expected a finite number other than 0 (negative is allowed: ICL-NUIM flips y)"
    )]
    FocalLength {
        /// `fx` or `fy`.
        name: &'static str,
        /// What was found.
        value: f64,
    },
    /// Some other number is outside its range.
    #[error("{name} is {value}, expected {rule}")]
    Value {
        /// Key in the file.
        name: &'static str,
        /// What was found.
        value: f64,
        /// What must hold.
        rule: &'static str,
    },
}

/// Intrinsics of the depth images (colour shares them where it is registered).
///
/// Distortion follows OpenCV's order `k1 k2 p1 p2 k3` and maps an ideal ray to the
/// distorted pixel. Raw depth 0 and 65535 mean no measurement.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Camera {
    /// Columns of the image, pixels.
    pub width: u32,
    /// Rows of the image, pixels.
    pub height: u32,
    /// Focal length along x, pixels.
    pub fx: f64,
    /// Focal length along y, pixels; negative where the image is flipped (ICL-NUIM).
    pub fy: f64,
    /// Principal point, column.
    pub cx: f64,
    /// Principal point, row.
    pub cy: f64,
    /// Raw depth divided by this is metres.
    pub units_per_metre: f64,
    /// Brown-Conrady coefficients `k1 k2 p1 p2 k3`; all zero: a plain pinhole.
    #[serde(default)]
    pub distortion: [f64; 5],
    /// Seconds from the exposure of the first depth row to that of the last; 0: global shutter.
    #[serde(default)]
    pub readout_s: f64,
    /// Metres to add to every measured depth.
    #[serde(default)]
    pub depth_offset_m: f64,
    /// Whether colour is registered to depth, pixel by pixel.
    #[serde(default = "yes")]
    pub colour_registered: bool,
    /// Seconds by which colour is newer than the depth of the same stamp. A start: the estimate
    /// from the frames begins there (method 14.4), and so below.
    #[serde(default)]
    pub colour_lag_s: f64,
    /// Focal length of the colour images over that of depth.
    #[serde(default = "one")]
    pub colour_focal_ratio: f64,
}

fn one() -> f64 {
    1.0
}

fn yes() -> bool {
    true
}

impl Camera {
    /// Longest long side and longest short side of an image, pixels.
    pub const MOST_LONG: u32 = 1920;
    /// As [`Self::MOST_LONG`], of the short side.
    pub const MOST_SHORT: u32 = 1080;

    /// Mean focal length of both axes, pixels.
    pub fn focal_px(&self) -> f64 {
        0.5 * (self.fx.abs() + self.fy.abs())
    }

    /// A pinhole without distortion whose rows are exposed at once, `width` x `height` pixels;
    /// `[fx, fy, cx, cy]` in pixels; raw depth divided by `units_per_metre` is metres.
    pub fn pinhole((width, height): (u32, u32), [fx, fy, cx, cy]: [f64; 4], units_per_metre: f64) -> Self {
        Self {
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            units_per_metre,
            distortion: [0.0; 5],
            readout_s: 0.0,
            depth_offset_m: 0.0,
            colour_registered: true,
            colour_lag_s: 0.0,
            colour_focal_ratio: 1.0,
        }
    }

    /// Checks every number, NaN included.
    ///
    /// # Errors
    /// Names the first value that cannot be, what it is and what it must be.
    pub fn check(&self) -> Result<(), CameraError> {
        let &Self { width, height, fx, fy, cx, cy, units_per_metre, readout_s, depth_offset_m, .. } = self;
        let &Self { colour_lag_s, colour_focal_ratio, .. } = self;
        let (long, short) = (width.max(height), width.min(height));
        if !(short >= 16 && long <= Self::MOST_LONG && short <= Self::MOST_SHORT) {
            return Err(CameraError::Size { width, height });
        }
        for (name, value) in [("fx", fx), ("fy", fy)] {
            if !(value.is_finite() && value.abs() > 1.0) {
                return Err(CameraError::FocalLength { name, value });
            }
        }
        let inside = |value: f64, side: u32| value >= -f64::from(side) && value <= 2.0 * f64::from(side);
        let rules = [
            ("cx", cx, inside(cx, width), "a column near the image"),
            ("cy", cy, inside(cy, height), "a row near the image"),
            (
                "units_per_metre",
                units_per_metre,
                units_per_metre > 0.0 && units_per_metre <= 1e6,
                "above 0, at most 1e6",
            ),
            ("readout_s", readout_s, readout_s.abs() <= 0.2, "a readout time from -0.2 to 0.2 seconds"),
            (
                "depth_offset_m",
                depth_offset_m,
                depth_offset_m.abs() <= 0.2,
                "an offset from -0.2 to 0.2 metres",
            ),
            ("colour_lag_s", colour_lag_s, colour_lag_s.abs() <= 0.1, "a lag from -0.1 to 0.1 seconds"),
            (
                "colour_focal_ratio",
                colour_focal_ratio,
                (0.75..=1.25).contains(&colour_focal_ratio),
                "a ratio from 0.75 to 1.25",
            ),
        ];
        for (name, value, holds, rule) in rules {
            if !holds {
                return Err(CameraError::Value { name, value, rule });
            }
        }
        for value in self.distortion {
            if !(value.abs() <= 10.0) {
                return Err(CameraError::Value {
                    name: "distortion",
                    value,
                    rule: "five numbers from -10 to 10",
                });
            }
        }
        Ok(())
    }

    /// Whether any distortion coefficient is set.
    pub fn is_distorted(&self) -> bool {
        self.distortion.iter().any(|&k| k != 0.0)
    }

    /// Distorts normalised image coordinates `(x/z, y/z)`.
    #[inline(always)]
    pub fn distort(&self, x: f64, y: f64) -> (f64, f64) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// The derivative of [`Self::distort`], a symmetric matrix `[a b; b d]` as `[a, b, d]`.
    #[inline(always)]
    pub fn distortion_slope(&self, x: f64, y: f64) -> [f64; 3] {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        let slope = 2.0 * (k1 + r2 * (2.0 * k2 + 3.0 * k3 * r2));
        let a = radial + slope * x * x + 2.0 * p1 * y + 6.0 * p2 * x;
        let b = slope * x * y + 2.0 * p1 * x + 2.0 * p2 * y;
        let d = radial + slope * y * y + 6.0 * p1 * y + 2.0 * p2 * x;
        [a, b, d]
    }

    /// Undistorts normalised image coordinates by Newton's method with a numeric safeguard.
    #[inline(always)]
    pub fn undistort(&self, xd: f64, yd: f64) -> (f64, f64) {
        let (mut x, mut y) = (xd, yd);
        if !self.is_distorted() {
            return (x, y);
        }
        for _ in 0..20 {
            let (fx, fy) = self.distort(x, y);
            let (ex, ey) = (fx - xd, fy - yd);
            let [a, b, d] = self.distortion_slope(x, y);
            let det = a * d - b * b;
            if !(det.abs() > 1e-6) {
                break;
            }
            let inverse = 1.0 / det;
            x -= (d * ex - b * ey) * inverse;
            y -= (a * ey - b * ex) * inverse;
            // A step squares the error: of the next one nothing would be left.
            if ex.abs() + ey.abs() < 1e-7 {
                break;
            }
        }
        (x, y)
    }

    /// Pixel `(row, column)` of a point in the camera frame; `None` behind the camera.
    #[inline]
    pub fn project(&self, point: &Vector3<f64>) -> Option<(f64, f64)> {
        if !(point.z > 0.0) {
            return None;
        }
        let (x, y) = self.distort(point.x / point.z, point.y / point.z);
        Some((self.fy * y + self.cy, self.fx * x + self.cx))
    }

    /// Ray `(x/z, y/z, 1)` through a pixel.
    #[inline(always)]
    pub fn ray(&self, row: f64, column: f64) -> Vector3<f64> {
        let (x, y) = self.undistort((column - self.cx) / self.fx, (row - self.cy) / self.fy);
        Vector3::new(x, y, 1.0)
    }

    /// Seconds between the exposure of `row` and the frame's stamp (method 1.6).
    #[inline]
    pub fn row_time_s(&self, row: f64) -> f64 {
        ((row + 0.5) / f64::from(self.height) - 0.5) * self.readout_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    pub(crate) fn freiburg1() -> Camera {
        Camera {
            width: 640,
            height: 480,
            fx: 517.306408,
            fy: 516.469215,
            cx: 318.64304,
            cy: 255.313989,
            units_per_metre: 5000.0,
            distortion: [0.262383, -0.953104, -0.005358, 0.002628, 1.163314],
            readout_s: 0.03,
            depth_offset_m: 0.0,
            colour_registered: true,
            colour_lag_s: 0.0,
            colour_focal_ratio: 1.0,
        }
    }

    #[test]
    fn projection_inverts_the_ray_of_every_pixel() {
        let camera = freiburg1();
        for row in (0..480).step_by(13) {
            for column in (0..640).step_by(17) {
                let ray = camera.ray(f64::from(row), f64::from(column));
                let (r, c) = camera.project(&(ray * 2.5)).unwrap();
                assert!(
                    (r - f64::from(row)).abs() < 1e-6 && (c - f64::from(column)).abs() < 1e-6,
                    "{row} {column}: {r} {c}"
                );
            }
        }
    }

    #[test]
    fn a_bad_number_is_named() {
        let bad = Camera { fx: 0.0, ..freiburg1() };
        assert!(bad.check().unwrap_err().to_string().contains("fx is 0"));
        let bad = Camera { units_per_metre: f64::NAN, ..freiburg1() };
        assert!(bad.check().unwrap_err().to_string().contains("units_per_metre is NaN"));
        assert!(Camera { fy: -480.0, ..freiburg1() }.check().is_ok());
    }

    #[test]
    fn rows_are_exposed_around_the_stamp() {
        let camera = freiburg1();
        assert!((camera.row_time_s(239.5)).abs() < 1e-12);
        assert!(camera.row_time_s(0.0) < 0.0 && camera.row_time_s(479.0) > 0.0);
    }
}
