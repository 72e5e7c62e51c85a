//! Standard deviation of a depth measurement as a function of depth (eq. 5; method 1.4).

/// Standard deviation of a depth measurement, a quadratic in depth (Holz and Behnke 2015, eq. 5):
/// `0.00263 z^2 - 0.00519 z + 0.00755` metres, never below 4.99 mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthNoise {
    quadratic: f32,
    linear: f32,
    constant: f32,
}

impl DepthNoise {
    /// Standard deviation in metres of a measurement at `depth_m` metres.
    #[inline(always)]
    pub fn sigma_m(&self, depth_m: f32) -> f32 {
        (self.quadratic * depth_m + self.linear) * depth_m + self.constant
    }
}

impl Default for DepthNoise {
    fn default() -> Self {
        Self { quadratic: 0.00263, linear: -0.00519, constant: 0.00755 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_table_is_reproduced() {
        // method 1.4, in millimetres.
        let table = [
            (0.5, 5.6),
            (0.8, 5.1),
            (1.0, 5.0),
            (1.5, 5.7),
            (2.0, 7.7),
            (3.0, 15.6),
            (4.0, 28.9),
            (5.0, 47.4),
            (6.0, 71.1),
            (8.0, 134.3),
        ];
        let noise = DepthNoise::default();
        for (depth_m, sigma_mm) in table {
            assert!((noise.sigma_m(depth_m) * 1e3 - sigma_mm).abs() < 0.1, "at {depth_m} m");
        }
        let mut depth_m = 0.3;
        while depth_m < 10.0 {
            assert!(noise.sigma_m(depth_m) > 0.0);
            depth_m += 0.01;
        }
    }
}
