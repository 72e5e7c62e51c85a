//! Which depth stands for a cell of `n x n` pixels.

use crate::settings::CellSample;
use tessera_geometry::{Camera, DepthNoise};

/// One cell's measurement: depth and the pixel it belongs to, relative to the cell's corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct CellDepth {
    pub(crate) depth_m: f32,
    pub(crate) row: f32,
    pub(crate) column: f32,
}

/// The choice of a cell's depth, with its constants worked out.
#[derive(Clone, Debug)]
pub(crate) struct CellRule {
    step: usize,
    sample: CellSample,
    metres_per_unit: f32,
    max_depth_m: f32,
    noise: DepthNoise,
}

impl CellRule {
    pub(crate) fn new(
        camera: &Camera,
        step: usize,
        sample: CellSample,
        max_depth_m: f32,
        noise: DepthNoise,
    ) -> Self {
        Self { step, sample, metres_per_unit: (1.0 / camera.units_per_metre) as f32, max_depth_m, noise }
    }

    pub(crate) fn averages(&self) -> bool {
        self.sample == CellSample::Mean
    }

    /// Metres; 0 where there is no measurement (raw 0 and 65535, or too far).
    #[inline(always)]
    fn metres(&self, raw: u16) -> f32 {
        let depth_m = if raw == u16::MAX { 0.0 } else { f32::from(raw) * self.metres_per_unit };
        if depth_m <= self.max_depth_m { depth_m } else { 0.0 }
    }

    /// The mean of a whole cell whose depths span at most four standard deviations; 0 sends it to
    /// [`Self::measure`]. The mean of depth and that of disparity differ by less than
    /// 0.1 mm over such a span.
    #[inline(always)]
    pub(crate) fn whole_mean(&self, least: u16, most: u16, sum: u32) -> f32 {
        let area = (self.step * self.step) as f32;
        let mean_m = sum as f32 / area * self.metres_per_unit;
        // `most >= least`, but the compiler does not know and would branch on the overflow.
        let span_m = (f32::from(most) - f32::from(least)) * self.metres_per_unit;
        let is_measured =
            (least > 0) & (most < u16::MAX) & (f32::from(most) * self.metres_per_unit <= self.max_depth_m);
        if is_measured & (span_m <= 4.0 * self.noise.sigma_m(mean_m)) { mean_m } else { 0.0 }
    }

    /// The depth of any cell, whole or with holes, at an edge or not.
    pub(crate) fn measure(
        &self,
        depth: &[u16],
        width: usize,
        top: usize,
        left: usize,
        height: usize,
    ) -> Option<CellDepth> {
        let (n_rows, n_columns) = (self.step.min(height - top), self.step.min(width - left));
        let at = |r: usize, c: usize| self.metres(depth[(top + r) * width + left + c]);
        match self.sample {
            CellSample::Corner => {
                let depth_m = at(0, 0);
                (depth_m > 0.0).then_some(CellDepth { depth_m, row: 0.0, column: 0.0 })
            }
            CellSample::Nearest => nearest_to(n_rows, n_columns, (0, 0), at),
            CellSample::Mean => {
                // The surface in the cell's middle decides; the others do not pull on it.
                let reference = nearest_to(n_rows, n_columns, (n_rows - 1, n_columns - 1), at)?.depth_m;
                let tolerance_m = 2.0 * self.noise.sigma_m(reference);
                let (mut sum, mut n, mut sum_row, mut sum_column) = (0.0f32, 0.0f32, 0.0f32, 0.0f32);
                for r in 0..n_rows {
                    for c in 0..n_columns {
                        let depth_m = at(r, c);
                        if depth_m > 0.0 && (depth_m - reference).abs() <= tolerance_m {
                            sum += depth_m;
                            sum_row += r as f32;
                            sum_column += c as f32;
                            n += 1.0;
                        }
                    }
                }
                Some(CellDepth { depth_m: sum / n, row: sum_row / n, column: sum_column / n })
            }
        }
    }
}

/// The measured pixel nearest to a place given in half pixels, rows first among equals.
fn nearest_to(
    n_rows: usize,
    n_columns: usize,
    half_place: (usize, usize),
    at: impl Fn(usize, usize) -> f32,
) -> Option<CellDepth> {
    let mut best: Option<(usize, CellDepth)> = None;
    for r in 0..n_rows {
        for c in 0..n_columns {
            let (dr, dc) = ((2 * r).abs_diff(half_place.0), (2 * c).abs_diff(half_place.1));
            let distance = dr * dr + dc * dc;
            let depth_m = at(r, c);
            if depth_m > 0.0 && best.is_none_or(|(d, _)| distance < d) {
                best = Some((distance, CellDepth { depth_m, row: r as f32, column: c as f32 }));
            }
        }
    }
    best.map(|(_, cell)| cell)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(sample: CellSample) -> CellRule {
        let camera = Camera {
            width: 16,
            height: 16,
            fx: 525.0,
            fy: 525.0,
            cx: 8.0,
            cy: 8.0,
            units_per_metre: 1000.0,
            distortion: [0.0; 5],
            readout_s: 0.0,
            colour_registered: true,
        };
        CellRule::new(&camera, 4, sample, 8.0, DepthNoise::default())
    }

    #[test]
    fn a_hole_at_the_corner_costs_the_vertex_only_by_the_corner_rule() {
        let mut depth = vec![1000u16; 256];
        depth[0] = 0;
        assert_eq!(rule(CellSample::Corner).measure(&depth, 16, 0, 0, 16), None);
        assert_eq!(rule(CellSample::Nearest).measure(&depth, 16, 0, 0, 16).map(|c| c.column), Some(1.0));
        let mean = rule(CellSample::Mean).measure(&depth, 16, 0, 0, 16).unwrap();
        // Fifteen pixels: the mean pixel is a little below and right of the middle.
        assert!((mean.depth_m - 1.0).abs() < 1e-6 && (mean.row - 1.6).abs() < 1e-6);
    }

    #[test]
    fn depths_are_not_averaged_across_an_edge() {
        let mut depth = vec![1000u16; 256];
        for row in 0..16 {
            depth[row * 16 + 3] = 2000;
        }
        let mean = rule(CellSample::Mean);
        assert!((mean.measure(&depth, 16, 0, 0, 16).unwrap().depth_m - 1.0).abs() < 1e-6);
        assert_eq!(mean.whole_mean(1000, 2000, 12 * 1000 + 4 * 2000), 0.0);
        assert_eq!(mean.whole_mean(0, 1000, 15 * 1000), 0.0, "a hole is no whole cell");
        assert_eq!(mean.whole_mean(1000, u16::MAX, 15 * 1000), 0.0);
    }
}
