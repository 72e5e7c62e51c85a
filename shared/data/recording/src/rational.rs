//! A lens of eight coefficients, taken out of images as they are read.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "places within an image whose camera was checked"
)]

use std::sync::Arc;
use tessera_geometry::Camera;

/// A pixel that no pixel of the image as taken corresponds to.
const OUTSIDE: u32 = u32::MAX;
/// Steps along a radius at which the lens is tried.
const N_RADII: usize = 64;

/// The rational lens of OpenCV, `rational_polynomial` in ROS: `k1 k2 p1 p2 k3 k4 k5 k6`. Radially
/// it scales by `(1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct RationalLens(pub(super) [f64; 8]);

impl RationalLens {
    /// Whether the rays of a pinhole with the camera's other numbers have one pixel each: along
    /// every radius of the image the distorted radius grows.
    pub(super) fn is_usable(&self, camera: &Camera) -> bool {
        let corner = |column: u32, row: u32| {
            let (x, y) = normalised(camera, column, row);
            x * x + y * y
        };
        let (right, bottom) = (camera.width - 1, camera.height - 1);
        let corners = [corner(0, 0), corner(right, 0), corner(0, bottom), corner(right, bottom)];
        let largest = corners.into_iter().fold(0.0, f64::max);
        let radii = (1..=N_RADII).map(|k| {
            let r2 = largest * (k * k) as f64 / (N_RADII * N_RADII) as f64;
            r2.sqrt() * self.radial(r2)
        });
        let mut before = 0.0;
        radii.into_iter().all(|radius| {
            let grows = radius > before;
            before = radius;
            grows
        })
    }

    fn radial(&self, r2: f64) -> f64 {
        let [k1, k2, _, _, k3, k4, k5, k6] = self.0;
        (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    }

    /// Distorts normalised image coordinates `(x/z, y/z)`.
    fn distort(&self, x: f64, y: f64) -> (f64, f64) {
        let [_, _, p1, p2, ..] = self.0;
        let r2 = x * x + y * y;
        let radial = self.radial(r2);
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }
}

fn normalised(camera: &Camera, column: u32, row: u32) -> (f64, f64) {
    ((f64::from(column) - camera.cx) / camera.fx, (f64::from(row) - camera.cy) / camera.fy)
}

/// From an image as taken to that of a pinhole with the same focal lengths and principal point.
#[derive(Clone, Debug)]
pub(super) struct Undistortion {
    /// For each pixel of the pinhole the nearest pixel of the image as taken.
    from: Arc<[u32]>,
}

impl Undistortion {
    /// `camera` has the numbers of the image beside the lens.
    pub(super) fn new(lens: &RationalLens, camera: &Camera) -> Self {
        let Camera { width, height, .. } = *camera;
        let pixels = (0..height).flat_map(|row| (0..width).map(move |column| (row, column)));
        let nearest = pixels.map(|(row, column)| {
            let (x, y) = normalised(camera, column, row);
            let (x, y) = lens.distort(x, y);
            let (column, row) =
                ((camera.fx * x + camera.cx + 0.5).floor(), (camera.fy * y + camera.cy + 0.5).floor());
            let is_inside =
                column >= 0.0 && row >= 0.0 && column < f64::from(width) && row < f64::from(height);
            if is_inside { row as u32 * width + column as u32 } else { OUTSIDE }
        });
        Self { from: nearest.collect() }
    }

    /// Takes `n_channels` values a pixel; zeros where the image as taken has nothing.
    pub(super) fn apply<T: Copy + Default>(&self, n_channels: usize, taken: &[T], to: &mut [T]) {
        for (pixel, from) in to.chunks_exact_mut(n_channels).zip(self.from.iter()) {
            let at = *from as usize * n_channels;
            match taken.get(at..at + n_channels) {
                Some(values) if *from != OUTSIDE => pixel.copy_from_slice(values),
                _ => pixel.fill(T::default()),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn camera() -> Camera {
        Camera::pinhole((640, 576), [504.2, 504.3, 321.7, 332.9], 1000.0)
    }

    #[test]
    fn a_lens_of_five_coefficients_is_that_of_the_camera_model() {
        let [k1, k2, p1, p2, k3] = [0.26, -0.25, -0.002, 0.003, 0.12];
        let lens = RationalLens([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]);
        let five = Camera { distortion: [k1, k2, p1, p2, k3], ..camera() };
        let undistortion = Undistortion::new(&lens, &camera());
        // Each pixel of the image as taken tells its own number.
        let taken: Vec<u32> = (0..640 * 576).collect();
        let mut found = vec![0; taken.len()];
        undistortion.apply(1, &taken, &mut found);
        for (row, column) in [(333, 322), (40, 60), (500, 600), (100, 500)] {
            let ray = camera().ray(f64::from(row), f64::from(column));
            let (r, c) = five.project(&Vector3::new(ray.x, ray.y, 1.0)).unwrap();
            let at = found[row as usize * 640 + column as usize];
            assert!((f64::from(at / 640) - r).abs() <= 0.51 && (f64::from(at % 640) - c).abs() <= 0.51);
        }
    }

    #[test]
    fn a_lens_that_folds_the_image_is_not_usable() {
        assert!(RationalLens([0.51, -2.65, 0.0, 0.0, 1.52, 0.39, -2.46, 1.45]).is_usable(&camera()));
        assert!(!RationalLens([-3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1]).is_usable(&camera()));
        assert!(!RationalLens([f64::NAN; 8]).is_usable(&camera()));
    }

    #[test]
    fn pixels_beyond_the_image_are_empty() {
        let lens = RationalLens([2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let mut to = vec![7_u16; 640 * 576];
        Undistortion::new(&lens, &camera()).apply(1, &vec![5; 640 * 576], &mut to);
        assert_eq!((to[0], to[640 * 333 + 322]), (0, 5));
    }
}
