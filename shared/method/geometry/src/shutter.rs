//! Rolling shutter: where the camera was when a row was exposed (method 1.6).

use crate::{Camera, Pose, Twist, exp};

/// The motion of one frame during its readout, as one rigid transform per row.
#[derive(Clone, Debug)]
pub struct RollingShutter {
    /// `camera_at_stamp_from_camera_at_row`, one per row band.
    bands: Vec<Pose>,
    rows_per_band: f64,
}

impl RollingShutter {
    /// Tabulates the motion for bands of `rows_per_band` image rows.
    ///
    /// `velocity` is the frame's own motion per second in its camera frame:
    /// `camera(t)_from_camera(t + dt) = exp(velocity dt)`.
    pub fn new(camera: &Camera, velocity: &Twist, rows_per_band: usize) -> Self {
        let n_bands = (camera.height as usize).div_ceil(rows_per_band);
        let bands = (0..n_bands)
            .map(|band| exp(&velocity.scaled(camera.row_time_s((band * rows_per_band) as f64))))
            .collect();
        Self { bands, rows_per_band: rows_per_band as f64 }
    }

    /// The transform that moves a point seen in image row `row` to the frame's stamp.
    pub fn stamp_from_row(&self, row: f64) -> &Pose {
        let band = (row / self.rows_per_band + 0.5).max(0.0) as usize;
        &self.bands[band.min(self.bands.len() - 1)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn the_middle_row_does_not_move_and_no_readout_moves_nothing() {
        let mut camera =
            Camera { readout_s: 0.03, ..Camera::pinhole((640, 480), [525.0, 525.0, 319.5, 239.5], 5000.0) };
        let velocity = Twist { rho: Vector3::new(1.0, 0.0, 0.0), phi: Vector3::new(0.0, 2.0, 0.0) };
        let shutter = RollingShutter::new(&camera, &velocity, 1);
        assert!(shutter.stamp_from_row(239.5).translation.vector.norm() < 1e-4);
        assert!(shutter.stamp_from_row(0.0).translation.vector.x < -0.014);
        camera.readout_s = 0.0;
        let still = RollingShutter::new(&camera, &velocity, 4);
        assert_eq!(*still.stamp_from_row(479.0), Pose::identity());
    }
}
