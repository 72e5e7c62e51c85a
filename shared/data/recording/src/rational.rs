//! A lens of eight coefficients, and the five of the camera model that come nearest to it.

use nalgebra::{Matrix3, Vector3};
use tessera_geometry::Camera;

/// Samples along each side of the image.
const SIDE: usize = 33;
/// Steps of the inversion, and how near it must come, as a share of the focal length.
const MOST_STEPS: usize = 500;
const NEAR: f64 = 1e-9;

/// The rational lens of OpenCV, `rational_polynomial` in ROS: `k1 k2 p1 p2 k3 k4 k5 k6`. Radially
/// it scales by `(1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RationalLens(pub(super) [f64; 8]);

/// A lens of five coefficients in place of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensFit {
    /// `k1 k2 p1 p2 k3`.
    pub distortion: [f64; 5],
    /// Largest distance between the two in the image, pixels.
    pub worst_px: f64,
    /// Root of the mean square of the distances over the image, pixels.
    pub rms_px: f64,
}

impl RationalLens {
    /// The five coefficients with the least squares over the image of `camera`, whose own
    /// distortion is not looked at. `None`: the lens folds the image over, or its numbers are not those of a lens.
    ///
    /// The tangential coefficients are the same in both, so that this is linear in `k1 k2 k3`.
    pub(super) fn fit(&self, camera: &Camera) -> Option<LensFit> {
        let squares = self.squares(camera)?;
        let largest = squares.iter().copied().fold(0.0, f64::max);
        // Powers of a share of the image keep the equations well conditioned.
        let powers = |r2: f64| {
            let share = r2 / largest;
            Vector3::new(share, share * share, share * share * share)
        };
        let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
        for &r2 in &squares {
            let row = powers(r2);
            a += r2 * row * row.transpose();
            b += r2 * (self.radial(r2) - 1.0) * row;
        }
        let solution = a.cholesky()?.solve(&b);
        let focal = camera.fx.abs().max(camera.fy.abs());
        let errors = squares.iter().map(|&r2| {
            let of_five = 1.0 + powers(r2).dot(&solution);
            focal * r2.sqrt() * (of_five - self.radial(r2)).abs()
        });
        let (worst_px, sum) = errors.fold((0.0, 0.0), |(worst, sum), e| (f64::max(worst, e), sum + e * e));
        let [_, _, p1, p2, ..] = self.0;
        let k = |at: usize| solution[at] / largest.powi(at as i32 + 1);
        let distortion = [k(0), k(1), p1, p2, k(2)];
        let is_finite = distortion.iter().all(|k| k.is_finite()) && worst_px.is_finite();
        is_finite.then(|| LensFit { distortion, worst_px, rms_px: (sum / squares.len() as f64).sqrt() })
    }

    fn radial(&self, r2: f64) -> f64 {
        let [k1, k2, _, _, k3, k4, k5, k6] = self.0;
        (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    }

    /// Squares of the distance from the axis of rays through pixels all over the image.
    fn squares(&self, camera: &Camera) -> Option<Vec<f64>> {
        let at = |k: usize, side: u32| f64::from(side - 1) * k as f64 / (SIDE - 1) as f64;
        let pixels = (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column)));
        pixels
            .map(|(row, column)| {
                let x = (at(column, camera.width) - camera.cx) / camera.fx;
                let y = (at(row, camera.height) - camera.cy) / camera.fy;
                self.undistort(x, y).map(|(x, y)| x * x + y * y)
            })
            .collect()
    }

    fn undistort(&self, xd: f64, yd: f64) -> Option<(f64, f64)> {
        let [_, _, p1, p2, ..] = self.0;
        let (mut x, mut y) = (xd, yd);
        for _ in 0..MOST_STEPS {
            let r2 = x * x + y * y;
            let radial = self.radial(r2);
            if !(radial > 0.0) {
                return None;
            }
            let (tx, ty) =
                (2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x), p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
            let (ex, ey) = (x * radial + tx - xd, y * radial + ty - yd);
            if ex.abs() + ey.abs() < NEAR {
                return Some((x, y));
            }
            (x, y) = (x - ex / radial, y - ey / radial);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Camera {
        Camera {
            width: 640,
            height: 576,
            fx: 504.2,
            fy: 504.3,
            cx: 321.7,
            cy: 332.9,
            units_per_metre: 1000.0,
            distortion: [0.0; 5],
            readout_s: 0.0,
            depth_offset_m: 0.0,
            colour_registered: true,
        }
    }

    #[test]
    fn a_lens_of_five_coefficients_is_found_again() {
        let five = [0.26, -0.25, -0.002, 0.003, 0.12];
        let [k1, k2, p1, p2, k3] = five;
        let fit = RationalLens([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]).fit(&camera()).unwrap();
        for (found, expected) in fit.distortion.iter().zip(five) {
            assert!((found - expected).abs() < 1e-9, "{fit:?}");
        }
        assert!(fit.worst_px < 1e-8, "{fit:?}");
    }

    #[test]
    fn the_distance_is_that_of_the_pixels() {
        let lens = RationalLens([0.51, -0.65, 0.001, -0.001, 0.12, 0.39, -0.46, 0.05]);
        let fit = lens.fit(&camera()).unwrap();
        let near = Camera { distortion: fit.distortion, ..camera() };
        let mut worst: f64 = 0.0;
        for (column, row) in [(0.0, 0.0), (639.0, 0.0), (0.0, 575.0), (639.0, 575.0), (320.0, 0.0)] {
            let (xd, yd) = ((column - near.cx) / near.fx, (row - near.cy) / near.fy);
            let (x, y) = lens.undistort(xd, yd).unwrap();
            let (r, c) = near.project(&Vector3::new(x, y, 1.0)).unwrap();
            let distance = (r - row).hypot(c - column);
            assert!(distance <= fit.worst_px * 1.001, "{distance} px at {row} {column}: {fit:?}");
            worst = worst.max(distance);
        }
        assert!(worst > 0.5 * fit.worst_px && fit.rms_px < fit.worst_px, "{worst} px: {fit:?}");
    }

    #[test]
    fn what_folds_the_image_has_no_fit() {
        assert_eq!(RationalLens([-3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1]).fit(&camera()), None);
        assert_eq!(RationalLens([f64::NAN; 8]).fit(&camera()), None);
    }
}
