//! Images as a pinhole without distortion sees them, the first row on top: what reconstruction from images
//! expects.

use tessera_geometry::Camera;

/// From the images of a camera to those of a pinhole at the same place.
pub(crate) struct Straightened {
    /// The pinhole.
    pub camera: Camera,
    /// For each of its pixels the place in the images as taken, row and column.
    places: Option<Vec<(f32, f32)>>,
    size: (u32, u32),
}

impl Straightened {
    /// The pinhole that is nearest to a camera, and the way to its images.
    pub(crate) fn of(camera: &Camera) -> Self {
        let (fx, fy) = (camera.fx.abs(), camera.fy.abs());
        // An axis against the image's is a flipped image.
        let cx = if camera.fx < 0.0 { f64::from(camera.width) - 1.0 - camera.cx } else { camera.cx };
        let cy = if camera.fy < 0.0 { f64::from(camera.height) - 1.0 - camera.cy } else { camera.cy };
        let size = (camera.width, camera.height);
        let pinhole = Camera::pinhole(size, [fx, fy, cx, cy], camera.units_per_metre);
        let is_it = !camera.is_distorted() && camera.fx > 0.0 && camera.fy > 0.0;
        Self { places: (!is_it).then(|| places(&pinhole, camera)), camera: pinhole, size }
    }

    /// As [`Self::of`], for images of another camera at the same place.
    pub(crate) fn to(pinhole: &Camera, from: &Camera) -> Self {
        let size = (from.width, from.height);
        let numbers = |c: &Camera| (c.width, c.height, c.fx, c.fy, c.cx, c.cy);
        let is_it = !from.is_distorted() && numbers(from) == numbers(pinhole);
        Self { places: (!is_it).then(|| places(pinhole, from)), camera: pinhole.clone(), size }
    }

    /// Whether images are what they were.
    pub(crate) fn is_as_taken(&self) -> bool {
        self.places.is_none()
    }

    /// Red, green, blue between the pixels as taken; black where there are none.
    pub(crate) fn colour(&self, taken: Vec<u8>) -> Vec<u8> {
        let Some(places) = &self.places else { return taken };
        let (width, height) = (self.size.0 as usize, self.size.1 as usize);
        let mut straight = Vec::with_capacity(3 * places.len());
        for &(row, column) in places {
            let (top, left) = (row.floor(), column.floor());
            let is_inside =
                row >= 0.0 && column >= 0.0 && row <= (height - 1) as f32 && column <= (width - 1) as f32;
            if !is_inside {
                straight.extend([0; 3]);
                continue;
            }
            let (down, right) = (row - top, column - left);
            let (y, x) = (top as usize, left as usize);
            let (y1, x1) = ((y + 1).min(height - 1), (x + 1).min(width - 1));
            for channel in 0..3 {
                let at = |y: usize, x: usize| f32::from(taken[3 * (y * width + x) + channel]);
                let upper = at(y, x) + right * (at(y, x1) - at(y, x));
                let lower = at(y1, x) + right * (at(y1, x1) - at(y1, x));
                straight.push((upper + down * (lower - upper) + 0.5) as u8);
            }
        }
        straight
    }

    /// Depth of the nearest pixels as taken; 0 where there are none.
    pub(crate) fn depth(&self, taken: Vec<u16>) -> Vec<u16> {
        let Some(places) = &self.places else { return taken };
        let (width, height) = (self.size.0 as f32, self.size.1 as f32);
        let nearest = |&(row, column): &(f32, f32)| {
            let (row, column) = ((row + 0.5).floor(), (column + 0.5).floor());
            let is_inside = row >= 0.0 && column >= 0.0 && row < height && column < width;
            if is_inside { taken[row as usize * self.size.0 as usize + column as usize] } else { 0 }
        };
        places.iter().map(nearest).collect()
    }
}

/// Where a camera sees what each pixel of a pinhole sees; nowhere is NaN.
fn places(pinhole: &Camera, camera: &Camera) -> Vec<(f32, f32)> {
    let pixels = (0..pinhole.height).flat_map(|row| (0..pinhole.width).map(move |column| (row, column)));
    let place = |(row, column)| {
        let ray = pinhole.ray(f64::from(row), f64::from(column));
        let (row, column) = camera.project(&ray).unwrap_or((f64::NAN, f64::NAN));
        (row as f32, column as f32)
    };
    pixels.map(place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (40, 30);

    fn chart() -> Vec<u8> {
        (0..30).flat_map(|row| (0..40).flat_map(move |column| [5 * column, 7 * row, 100])).collect()
    }

    #[test]
    fn a_flipped_image_is_turned_back() {
        let camera = Camera::pinhole(SIZE, [30.0, -31.0, 19.0, 14.0], 1000.0);
        let straightened = Straightened::of(&camera);
        let Camera { fy, cy, .. } = straightened.camera;
        assert_eq!((fy, cy, straightened.is_as_taken()), (31.0, 15.0, false));
        let turned: Vec<u8> = chart().chunks(120).rev().flatten().copied().collect();
        let found = straightened.colour(chart());
        assert!(found.iter().zip(&turned).all(|(a, b)| a.abs_diff(*b) <= 1));
        let depth: Vec<u16> = (0..1200).collect();
        assert_eq!(straightened.depth(depth)[0], 1160);
    }

    #[test]
    fn a_lens_is_taken_out_and_a_pinhole_is_left_alone() {
        let pinhole = Camera::pinhole(SIZE, [30.0, 30.0, 19.5, 14.5], 1000.0);
        let plain = Straightened::of(&pinhole);
        assert!(plain.is_as_taken() && plain.colour(chart()) == chart());
        let camera = Camera { distortion: [-0.2, 0.0, 0.0, 0.0, 0.0], ..pinhole.clone() };
        let found = Straightened::of(&camera).colour(chart());
        // 12 px left of the middle the lens shows what is at (1 - 0.2 r2) of that.
        let (row, column) = (14, 7);
        let r2 = (12.5f64 / 30.0).powi(2) + (0.5f64 / 30.0).powi(2);
        let expected = 5.0 * (19.5 - 12.5 * (1.0 - 0.2 * r2));
        assert!((f64::from(found[3 * (40 * row + column)]) - expected).abs() < 1.0);
        // A pinhole of another focal length sees more, and black beyond the border.
        let wide = Camera { fx: 20.0, fy: 20.0, ..pinhole.clone() };
        let found = Straightened::to(&wide, &pinhole).colour(chart());
        assert_eq!(found[..3], [0; 3]);
        assert!(Straightened::to(&pinhole, &pinhole).is_as_taken());
    }
}
