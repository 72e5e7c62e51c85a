//! Floats in metres as raw depth.

use crate::ImageError;

/// What no depth camera sees, metres: a table in millimetres is beyond it.
const FAR_M: f64 = 100.0;
/// Millimetres up to here are depths that a camera sees.
const MOST_FAR: f64 = 65_535.0;
/// Values beyond it for each nearer one from which on they are no metres: those of millimetres are near by
/// interpolation alone.
const MANY_TIMES: u64 = 20;

/// Counts metres in a camera's units, and notices where they are none.
#[derive(Clone, Copy, Debug)]
pub struct MetresDepth {
    units_per_metre: f64,
    n_near: u64,
    n_far: u64,
    least_far: f64,
    most_far: f64,
}

impl MetresDepth {
    /// For one image.
    pub fn new(units_per_metre: f64) -> Self {
        Self { units_per_metre, n_near: 0, n_far: 0, least_far: f64::INFINITY, most_far: 0.0 }
    }

    /// A value in units; 0 where it is no measurement: not finite, behind the camera, or beyond what a raw
    /// value holds.
    #[expect(clippy::cast_possible_truncation, reason = "a number from 1 to below 65535")]
    pub fn raw(&mut self, metres: f64) -> u16 {
        if metres > FAR_M && metres < MOST_FAR {
            self.n_far = self.n_far.saturating_add(1);
            self.least_far = self.least_far.min(metres);
            self.most_far = self.most_far.max(metres);
        } else if metres > 0.0 && metres <= FAR_M {
            self.n_near = self.n_near.saturating_add(1);
        }
        let units = (metres * self.units_per_metre).round();
        if units >= 1.0 && units < f64::from(u16::MAX) { units as u16 } else { 0 }
    }

    /// Refuses an image whose values are millimetres. A single far value is the sky of a renderer.
    ///
    /// # Errors
    /// The values, and what to do.
    pub fn check(&self) -> Result<(), ImageError> {
        let is_of_millimetres =
            self.n_far > self.n_near.saturating_mul(MANY_TIMES) && self.least_far < self.most_far;
        match is_of_millimetres {
            true => Err(ImageError::Millimetres { least: self.least_far, most: self.most_far }),
            false => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn millimetres_are_named_and_metres_with_a_sky_are_read() {
        let read = |values: &[f64]| {
            let mut depth = MetresDepth::new(1000.0);
            let raw: Vec<u16> = values.iter().map(|value| depth.raw(*value)).collect();
            depth.check().map(|()| raw).map_err(|error| error.to_string())
        };
        assert_eq!(read(&[1.5, 0.25, f64::NAN, -1.0, 70.0]), Ok(vec![1500, 250, 0, 0, 0]));
        assert_eq!(read(&[1000.0; 30]), Ok(vec![0; 30]));
        assert_eq!(read(&[0.0, f64::INFINITY]), Ok(vec![0, 0]));
        let words = read(&[1500.0, 2250.0, 0.0, 870.5]).unwrap_err();
        assert!(words.contains("floats from 870.5 to 2250") && words.contains("/ 1000"), "{words}");
    }
}
