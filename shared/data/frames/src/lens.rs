//! Lenses that the camera model does not have, taken out of images as they are read.
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

/// A lens that the camera model does not have: it is taken out of the images as they are read.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OtherLens {
    /// OpenCV's, `rational_polynomial` in ROS: `k1 k2 p1 p2 k3 k4 k5 k6`. Radially it scales by
    /// `(1 + k1 r2 + k2 r4 + k3 r6) / (1 + k4 r2 + k5 r4 + k6 r6)`.
    Rational([f64; 8]),
    /// A fisheye after Kannala and Brandt, `equidistant` in ROS: a ray at the angle `a` to the axis is seen at
    /// the radius `a (1 + k1 a2 + k2 a4 + k3 a6 + k4 a8)`.
    Equidistant([f64; 4]),
}

/// The lens of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StatedLens {
    /// `k1 k2 p1 p2 k3` of the camera model.
    Plain([f64; 5]),
    /// Another one.
    Other(OtherLens),
}

impl StatedLens {
    /// The lens of a model by its name in ROS, OpenCV, Kalibr or ORB-SLAM; coefficients that are all zero distort
    /// nothing, whatever the model. `None`: the model is not known, or has other coefficients.
    pub fn of_model(model: &str, coefficients: &[f64]) -> Option<Self> {
        let first = |n: usize| coefficients.iter().skip(n).all(|k| *k == 0.0);
        let taken = |to: &mut [f64]| to.iter_mut().zip(coefficients).for_each(|(to, k)| *to = *k);
        let (mut four, mut five, mut eight) = ([0.0; 4], [0.0; 5], [0.0; 8]);
        if first(0) {
            return Some(Self::Plain(five));
        }
        match model.to_lowercase().as_str() {
            "" | "plumb_bob" | "radtan" | "brown_conrady" | "brown conrady" | "inverse brown conrady"
                if first(5) =>
            {
                taken(&mut five);
                Some(Self::Plain(five))
            }
            // A rational polynomial whose denominator is 1 is the plain one.
            "rational_polynomial" | "rational" if first(5) => {
                taken(&mut five);
                Some(Self::Plain(five))
            }
            "rational_polynomial" | "rational" if first(8) && coefficients.len() >= 8 => {
                taken(&mut eight);
                Some(Self::Other(OtherLens::Rational(eight)))
            }
            "equidistant" | "fisheye" | "kannalabrandt8" | "kannala_brandt4" | "kannala_brandt"
                if first(4) =>
            {
                taken(&mut four);
                Some(Self::Other(OtherLens::Equidistant(four)))
            }
            _ => None,
        }
    }
}

impl OtherLens {
    /// Whether the rays of a pinhole with the camera's other numbers have one pixel each: along
    /// every radius of the image the distorted radius grows.
    pub fn is_usable(&self, camera: &Camera) -> bool {
        let corner = |column: u32, row: u32| {
            let (x, y) = normalised(camera, column, row);
            x * x + y * y
        };
        let (right, bottom) = (camera.width.saturating_sub(1), camera.height.saturating_sub(1));
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

    /// What is done about it, for people.
    pub fn words(&self) -> &'static str {
        match self {
            Self::Rational(_) => "rational lens taken out of the images",
            Self::Equidistant(_) => "fisheye lens taken out of the images",
        }
    }

    /// The factor of the distance from the axis, by the square of `(x/z, y/z)`.
    fn radial(&self, r2: f64) -> f64 {
        match self {
            Self::Rational([k1, k2, _, _, k3, k4, k5, k6]) => {
                (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            }
            Self::Equidistant([k1, k2, k3, k4]) => {
                let r = r2.sqrt();
                if r < 1e-9 {
                    return 1.0;
                }
                let angle = libm::atan(r);
                let a2 = angle * angle;
                angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))) / r
            }
        }
    }

    /// Distorts normalised image coordinates `(x/z, y/z)`.
    fn distort(&self, x: f64, y: f64) -> (f64, f64) {
        let r2 = x * x + y * y;
        let radial = self.radial(r2);
        let Self::Rational([_, _, p1, p2, ..]) = self else { return (x * radial, y * radial) };
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
pub struct Undistortion {
    /// For each pixel of the pinhole the nearest pixel of the image as taken.
    from: Arc<[u32]>,
}

impl Undistortion {
    /// `camera` has the numbers of the image beside the lens.
    pub fn new(lens: &OtherLens, camera: &Camera) -> Self {
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

    /// As [`Self::apply`], of an image in its place.
    pub fn straighten<T: Copy + Default>(&self, n_channels: usize, image: &mut [T]) {
        let taken = image.to_vec();
        self.apply(n_channels, &taken, image);
    }

    /// Takes `n_channels` values a pixel; zeros where the image as taken has nothing.
    pub fn apply<T: Copy + Default>(&self, n_channels: usize, taken: &[T], to: &mut [T]) {
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
        let lens = OtherLens::Rational([k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]);
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
        assert!(OtherLens::Rational([0.51, -2.65, 0.0, 0.0, 1.52, 0.39, -2.46, 1.45]).is_usable(&camera()));
        assert!(!OtherLens::Rational([-3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1]).is_usable(&camera()));
        assert!(!OtherLens::Rational([f64::NAN; 8]).is_usable(&camera()));
    }

    #[test]
    fn a_fisheye_is_that_of_kannala_and_brandt() {
        let k = [0.05, -0.01, 0.002, -0.0003];
        let lens = OtherLens::Equidistant(k);
        let camera = Camera::pinhole((640, 480), [285.0, 286.0, 321.0, 238.0], 1000.0);
        assert!(lens.is_usable(&camera));
        assert!(!OtherLens::Equidistant([-0.9, 0.0, 0.0, 0.0]).is_usable(&camera));
        let taken: Vec<u32> = (0..640 * 480).collect();
        let mut found = vec![0; taken.len()];
        Undistortion::new(&lens, &camera).apply(1, &taken, &mut found);
        for (row, column) in [(238, 321), (40, 60), (400, 600), (100, 500)] {
            // Angle and direction of the ray, then the projection of the paper's equation 6.
            let (x, y) = ((f64::from(column) - 321.0) / 285.0, (f64::from(row) - 238.0) / 286.0);
            let (angle, around) = (x.hypot(y).atan(), y.atan2(x));
            let radius = angle
                + k[0] * angle.powi(3)
                + k[1] * angle.powi(5)
                + k[2] * angle.powi(7)
                + k[3] * angle.powi(9);
            let (c, r) = (285.0 * radius * around.cos() + 321.0, 286.0 * radius * around.sin() + 238.0);
            let at = found[row as usize * 640 + column as usize];
            assert!((f64::from(at / 640) - r).abs() <= 0.51 && (f64::from(at % 640) - c).abs() <= 0.51);
        }
    }

    #[test]
    fn a_model_has_its_name_and_its_coefficients() {
        let of = StatedLens::of_model;
        let five = [0.1, -0.2, 0.0, 0.0, 0.3];
        assert_eq!(of("plumb_bob", &five), Some(StatedLens::Plain(five)));
        assert_eq!(
            of("rational_polynomial", &[five.as_slice(), &[0.0; 3]].concat()),
            Some(StatedLens::Plain(five))
        );
        let eight = [0.5, -2.6, 0.0, 0.0, 1.5, 0.4, -2.5, 1.4];
        assert_eq!(of("rational_polynomial", &eight), Some(StatedLens::Other(OtherLens::Rational(eight))));
        let four = [0.1, 0.2, 0.3, 0.4];
        assert_eq!(of("Equidistant", &four), Some(StatedLens::Other(OtherLens::Equidistant(four))));
        assert_eq!(of("equidistant", &[0.0; 4]), Some(StatedLens::Plain([0.0; 5])));
        for (model, k) in [("equidistant", &five[..]), ("plumb_bob", &eight), ("fov", &four)] {
            assert_eq!(of(model, k), None, "{model}");
        }
    }

    #[test]
    fn pixels_beyond_the_image_are_empty() {
        let lens = OtherLens::Rational([2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let mut to = vec![7_u16; 640 * 576];
        Undistortion::new(&lens, &camera()).apply(1, &vec![5; 640 * 576], &mut to);
        assert_eq!((to[0], to[640 * 333 + 322]), (0, 5));
    }
}
