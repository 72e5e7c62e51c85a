//! Colour of another camera, brought to the pixels of depth.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "places within an image of the camera's size, and matrices of floating-point numbers"
)]

use crate::ColourCamera;
use nalgebra::Vector3;
use tessera_geometry::{Camera, Pose};

/// Largest side of a colour image, pixels: bounds the memory of a decoded one.
const MOST_PX: u32 = 8192;

/// The colour camera beside the depth camera: another lens, another size, another place.
///
/// Each pixel of depth is lifted to its point, moved to the colour camera and projected there; the
/// nearest colour pixel is taken. What only the depth camera sees gets the colour of what hides it.
#[derive(Clone, Debug)]
pub struct ColourWarp {
    /// Columns and rows of the colour images, pixels.
    pub size: (u32, u32),
    colour: Camera,
    colour_from_depth: Pose,
    /// `x/z` and `y/z` of each pixel of depth, row by row.
    rays: Vec<(f32, f32)>,
    metres_per_unit: f64,
    /// Both cameras at one place: depth does not matter.
    is_at_one_place: bool,
}

impl ColourWarp {
    /// Prepares the rays of the depth camera. `colour_from_depth` takes points of the depth camera
    /// to the colour camera, metres. `None`: the numbers of the colour camera cannot be.
    pub fn new(depth: &Camera, colour: &Camera, colour_from_depth: Pose) -> Option<Self> {
        let size = (colour.width, colour.height);
        // A colour camera may be larger than a depth camera may.
        let checked =
            Camera { width: colour.width.min(1920), height: colour.height.min(1080), ..colour.clone() };
        if checked.check().is_err() || size.0.max(size.1) > MOST_PX {
            return None;
        }
        let pixels = (0..depth.height).flat_map(|row| (0..depth.width).map(move |column| (row, column)));
        let rays = pixels
            .map(|(row, column)| {
                let ray = depth.ray(f64::from(row), f64::from(column));
                (ray.x as f32, ray.y as f32)
            })
            .collect();
        Some(Self {
            size,
            colour: colour.clone(),
            colour_from_depth,
            rays,
            metres_per_unit: 1.0 / depth.units_per_metre,
            is_at_one_place: colour_from_depth.translation.vector.norm() < 1e-6,
        })
    }

    /// The colour camera.
    pub fn colour_camera(&self) -> ColourCamera {
        ColourCamera { camera: self.colour.clone(), colour_from_depth: self.colour_from_depth }
    }

    /// Colour at each pixel of depth, red, green, blue; black where depth says nothing or the colour
    /// camera does not look. `from` holds `3 * width * height` values of the colour camera.
    pub fn apply(&self, depth_raw: &[u16], from: &[u8], to: &mut [u8]) {
        for ((pixel, raw), ray) in to.chunks_exact_mut(3).zip(depth_raw).zip(&self.rays) {
            let colour = self.colour_pixel(*raw, *ray).and_then(|at| from.get(3 * at..3 * at + 3));
            pixel.copy_from_slice(colour.unwrap_or(&[0; 3]));
        }
    }

    /// Index of the colour pixel that sees what a pixel of depth sees.
    fn colour_pixel(&self, raw: u16, (x, y): (f32, f32)) -> Option<usize> {
        let depth_m = match raw {
            0 | u16::MAX if self.is_at_one_place => 1.0,
            0 | u16::MAX => return None,
            raw => f64::from(raw) * self.metres_per_unit,
        };
        let point = Vector3::new(f64::from(x), f64::from(y), 1.0) * depth_m;
        let point = self.colour_from_depth.rotation * point + self.colour_from_depth.translation.vector;
        let (row, column) = self.colour.project(&point)?;
        let (row, column) = ((row + 0.5).floor(), (column + 0.5).floor());
        let (width, height) = (f64::from(self.size.0), f64::from(self.size.1));
        let is_inside = row >= 0.0 && column >= 0.0 && row < height && column < width;
        is_inside.then(|| row as usize * self.size.0 as usize + column as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion};

    fn camera(width: u32, height: u32, focal: f64) -> Camera {
        Camera::pinhole(
            (width, height),
            [focal, focal, f64::from(width - 1) / 2.0, f64::from(height - 1) / 2.0],
            1000.0,
        )
    }

    /// Red tells the column of the colour image, green the row.
    fn chart(width: u32, height: u32) -> Vec<u8> {
        (0..height).flat_map(|row| (0..width).flat_map(move |column| [column as u8, row as u8, 9])).collect()
    }

    #[test]
    fn a_larger_image_at_the_same_place_needs_no_depth() {
        let warp = ColourWarp::new(&camera(20, 16, 20.0), &camera(40, 32, 40.0), Pose::identity()).unwrap();
        let mut to = vec![1; 3 * 20 * 16];
        warp.apply(&[0; 320], &chart(40, 32), &mut to);
        // The middle of both images is the same ray, and twice the pixels lie in between.
        let at = |row: usize, column: usize| to[3 * (20 * row + column)..][..2].to_vec();
        let (first, second) = (at(5, 7), at(5, 8));
        assert!(first[0].abs_diff(15) <= 1 && first[1].abs_diff(11) <= 1, "{first:?}");
        assert!(second[0] - first[0] <= 3 && second[1] == first[1], "{first:?} {second:?}");
    }

    #[test]
    fn a_camera_beside_sees_near_things_shifted() {
        // The colour camera stands 0.1 m to the right: at 1 m a point lies 20 * 0.1 = 2 px further left.
        let colour_from_depth =
            Pose::from_parts(Translation3::new(-0.1, 0.0, 0.0), UnitQuaternion::identity());
        let warp = ColourWarp::new(&camera(20, 16, 20.0), &camera(20, 16, 20.0), colour_from_depth).unwrap();
        let mut to = vec![1; 3 * 20 * 16];
        let mut depth = vec![1000; 320];
        depth[20 * 8 + 10] = 2000;
        depth[20 * 8 + 11] = 0;
        warp.apply(&depth, &chart(20, 16), &mut to);
        let column = |column: usize| to[3 * (20 * 8 + column)];
        assert_eq!((column(9), column(10), column(11)), (7, 9, 0));
        // Beyond the left border of the colour image.
        assert_eq!((column(1), to[3 * (20 * 8 + 1) + 2]), (0, 0));
    }

    #[test]
    fn a_colour_camera_that_cannot_be_is_refused() {
        let good = camera(20, 16, 20.0);
        assert!(ColourWarp::new(&good, &camera(2048, 1536, 1000.0), Pose::identity()).is_some());
        assert!(ColourWarp::new(&good, &camera(20, 16, f64::NAN), Pose::identity()).is_none());
        assert!(ColourWarp::new(&good, &camera(20_000, 16, 20.0), Pose::identity()).is_none());
    }
}
