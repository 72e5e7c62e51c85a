//! Depth as another camera sees it: of the points that fall on a pixel the nearest.

use nalgebra::Vector3;
use tessera_geometry::{Camera, Pose};

/// From depth images to those that the colour camera would see.
pub(crate) struct SeenFromColour {
    /// The colour camera, smaller by a whole step: its pixels are no finer than those of depth.
    pub camera: Camera,
    /// The depth camera's rays, row by row.
    rays: Vec<Vector3<f64>>,
    depth_camera: Camera,
    colour_from_depth: Pose,
}

impl SeenFromColour {
    /// Depth of `depth` as the pinhole `colour` sees it.
    pub(crate) fn new(depth: &Camera, colour: &Camera, colour_from_depth: Pose) -> Self {
        let step = (colour.fx / depth.fx.abs()).ceil().max(1.0);
        let size = (colour.width / step as u32, colour.height / step as u32);
        let middle = |c: f64| (c + 0.5) / step - 0.5;
        let numbers = [colour.fx / step, colour.fy / step, middle(colour.cx), middle(colour.cy)];
        let pixels = (0..depth.height).flat_map(|row| (0..depth.width).map(move |column| (row, column)));
        Self {
            camera: Camera::pinhole(size, numbers, depth.units_per_metre),
            rays: pixels.map(|(row, column)| depth.ray(f64::from(row), f64::from(column))).collect(),
            depth_camera: depth.clone(),
            colour_from_depth,
        }
    }

    /// Raw depth in the units of the depth camera; 0 where no point falls.
    pub(crate) fn depth(&self, taken: &[u16]) -> Vec<u16> {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let mut seen = vec![0; width * height];
        let units = self.depth_camera.units_per_metre;
        for (raw, ray) in taken.iter().zip(&self.rays).filter(|(raw, _)| !matches!(**raw, 0 | u16::MAX)) {
            let point = ray * (f64::from(*raw) / units + self.depth_camera.depth_offset_m);
            let point = self.colour_from_depth.rotation * point + self.colour_from_depth.translation.vector;
            let Some((row, column)) = self.camera.project(&point) else { continue };
            let (row, column) = ((row + 0.5).floor(), (column + 0.5).floor());
            if row >= 0.0 && column >= 0.0 && row < height as f64 && column < width as f64 {
                let place = &mut seen[row as usize * width + column as usize];
                let raw = ((point.z - self.depth_camera.depth_offset_m) * units + 0.5) as u16;
                *place = if *place == 0 { raw } else { raw.min(*place) };
            }
        }
        seen
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_beside_sees_the_nearer_of_two_points() {
        let depth = Camera::pinhole((40, 30), [30.0, 30.0, 19.5, 14.5], 1000.0);
        let colour = Camera::pinhole((80, 60), [60.0, 60.0, 39.5, 29.5], 1000.0);
        // The colour camera stands 0.1 m to the right: at 1 m a point lies 3 px further left.
        let seen = SeenFromColour::new(&depth, &colour, Pose::translation(-0.1, 0.0, 0.0));
        assert_eq!((seen.camera.width, seen.camera.fx, seen.camera.cx), (40, 30.0, 19.5));
        let mut taken = vec![0; 1200];
        taken[40 * 10 + 20] = 1000;
        // At 2 m 1.5 px: it falls on the same pixel or the one beside it.
        taken[40 * 10 + 18] = 2000;
        taken[40 * 10 + 19] = 2000;
        let found = seen.depth(&taken);
        assert_eq!(found[40 * 10 + 17], 1000);
        assert_eq!(found.iter().filter(|raw| **raw > 0).count(), 2);
    }
}
