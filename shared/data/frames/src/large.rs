//! Images that are larger than those that are processed: read in full and reduced by whole steps.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "blocks within an image whose size was checked"
)]

use tessera_geometry::{Camera, CameraError};

/// Longest side of an image that is read, pixels.
const MOST_SIDE: u32 = 8192;
/// Raw depths of a block within this share of their median are one surface.
const ONE_SURFACE: f64 = 0.02;

/// Checks a camera whose images may be larger than those that are processed.
///
/// # Errors
/// As [`Camera::check`].
pub fn check_camera(camera: &Camera) -> Result<(), CameraError> {
    if camera.width > MOST_SIDE || camera.height > MOST_SIDE {
        return Err(CameraError::Size { width: camera.width, height: camera.height });
    }
    reduced_camera(camera, reduction(camera)).check()
}

/// Pixels of a row that become one; 1: the images are processed as they are.
pub fn reduction(camera: &Camera) -> u32 {
    let is_small = |step: u32| {
        let (width, height) = (camera.width / step, camera.height / step);
        width.max(height) <= Camera::MOST_LONG && width.min(height) <= Camera::MOST_SHORT
    };
    (1..=MOST_SIDE).find(|step| is_small(*step)).unwrap_or(1)
}

/// The camera of the reduced images: blocks of `step` times `step` pixels become one, and what is left
/// over at the right and lower edge is cut off.
pub fn reduced_camera(camera: &Camera, step: u32) -> Camera {
    if step == 1 {
        return camera.clone();
    }
    let by = f64::from(step);
    // The middle of the first pixel is at 0, so the edge of its block is at -0.5.
    let centre = |c: f64| (c + 0.5) / by - 0.5;
    Camera {
        width: camera.width / step,
        height: camera.height / step,
        fx: camera.fx / by,
        fy: camera.fy / by,
        cx: centre(camera.cx),
        cy: centre(camera.cy),
        ..camera.clone()
    }
}

/// Reduces depth: the mean of those of a block that lie on the surface of its median.
pub fn reduce_depth(from: &[u16], width: u32, step: u32, to: &mut [u16], to_width: u32) {
    let (width, step) = (width as usize, step as usize);
    let mut block = Vec::with_capacity(step * step);
    for (row, pixels) in to.chunks_exact_mut(to_width as usize).enumerate() {
        for (column, pixel) in pixels.iter_mut().enumerate() {
            block.clear();
            for line in 0..step {
                let at = (row * step + line) * width + column * step;
                block.extend(from[at..at + step].iter().filter(|raw| **raw != 0 && **raw != u16::MAX));
            }
            // A block of which most is not measured lies at an edge.
            *pixel = if 2 * block.len() < step * step { 0 } else { surface(&mut block) };
        }
    }
}

fn surface(block: &mut [u16]) -> u16 {
    block.sort_unstable();
    let median = f64::from(block[(block.len() - 1) / 2]);
    let near =
        || block.iter().map(|raw| f64::from(*raw)).filter(|raw| (raw - median).abs() <= ONE_SURFACE * median);
    let n = near().count().max(1) as f64;
    (near().sum::<f64>() / n).round() as u16
}

/// Reduces red, green, blue to their means.
pub fn reduce_colour(from: &[u8], width: u32, step: u32, to: &mut [u8], to_width: u32) {
    let (width, step) = (width as usize, step as usize);
    let n = step * step;
    for (row, pixels) in to.chunks_exact_mut(3 * to_width as usize).enumerate() {
        for (column, pixel) in pixels.chunks_exact_mut(3).enumerate() {
            for (channel, value) in pixel.iter_mut().enumerate() {
                let mut sum = n / 2;
                for line in 0..step {
                    let at = (row * step + line) * width + column * step;
                    sum += (at..at + step).map(|at| usize::from(from[3 * at + channel])).sum::<usize>();
                }
                *value = (sum / n) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(width: u32, height: u32) -> Camera {
        let f = f64::from(width);
        Camera::pinhole((width, height), [f, f, f64::from(width) / 2.0, f64::from(height) / 2.0], 1000.0)
    }

    #[test]
    fn images_are_halved_until_they_fit_either_way_up() {
        for (size, step) in [
            ((1920, 1080), 1),
            ((1080, 1920), 1),
            ((960, 1280), 1),
            ((1920, 1200), 2),
            ((2048, 1536), 2),
            ((1440, 1920), 2),
            ((4096, 3072), 3),
            ((1921, 1080), 2),
        ] {
            let camera = camera(size.0, size.1);
            assert_eq!(reduction(&camera), step, "{size:?}");
            assert_eq!(check_camera(&camera), Ok(()));
            let reduced = reduced_camera(&camera, step);
            assert_eq!((reduced.width, reduced.height), (size.0 / step, size.1 / step));
            // A ray through the middle of a block goes through the middle of its pixel.
            let middle = f64::from(7 * step) + f64::from(step - 1) / 2.0;
            assert!((camera.ray(middle, middle) - reduced.ray(7.0, 7.0)).norm() < 1e-12);
        }
        assert!(check_camera(&camera(9000, 100)).is_err() && check_camera(&camera(8, 3000)).is_err());
    }

    #[test]
    fn depth_is_averaged_on_one_surface_and_never_across_an_edge() {
        let from = [1000, 1004, 0, 3000, 1002, 1002, 3000, 500, 0, 0, 700, u16::MAX, 0, 800, 0, 0];
        let mut to = [9; 4];
        reduce_depth(&from, 4, 2, &mut to, 2);
        assert_eq!(to, [1002, 3000, 0, 0]);
        let mut colour = [0; 6];
        reduce_colour(
            &[1, 2, 3, 3, 2, 1, 5, 5, 5, 9, 9, 9, 1, 2, 3, 3, 2, 1, 5, 5, 5, 9, 9, 9],
            4,
            2,
            &mut colour,
            2,
        );
        assert_eq!(colour, [2, 2, 2, 7, 7, 7]);
    }
}
