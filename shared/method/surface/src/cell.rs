//! Depth of a cell of `n x n` pixels.

use tessera_geometry::{Camera, DepthNoise};
use tessera_numerics::MethodVariant;

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
    /// The mean disparity of the pixels that lie on one surface, at their mean pixel; the paper's is the raw pixel at
    /// the cell's corner, where a hole costs the vertex.
    variant: MethodVariant,
    metres_per_unit: f32,
    depth_offset_m: f32,
    max_depth_m: f32,
    /// The largest raw depth that is a measurement.
    largest: u16,
    noise: DepthNoise,
    order: Vec<(u8, u8)>,
}

impl CellRule {
    pub(crate) fn new(
        camera: &Camera,
        step: usize,
        variant: MethodVariant,
        max_depth_m: f32,
        noise: DepthNoise,
    ) -> Self {
        let metres_per_unit = (1.0 / camera.units_per_metre) as f32;
        Self {
            step,
            variant,
            metres_per_unit,
            depth_offset_m: camera.depth_offset_m as f32,
            max_depth_m,
            largest: largest(metres_per_unit, max_depth_m),
            noise,
            order: order(step, variant),
        }
    }

    pub(crate) fn averages(&self) -> bool {
        !self.variant.is_paper()
    }

    /// The mean of a whole cell whose depths span at most four standard deviations; 0 sends it to
    /// [`Self::measure`]. The mean of depth and that of disparity differ by less than
    /// 0.1 mm over such a span.
    #[inline(always)]
    pub(crate) fn whole_mean(&self, least: u16, most: u16, sum: u32) -> f32 {
        // A power of two: the product is the quotient, to the bit.
        let share = 1.0 / (self.step * self.step) as f32;
        let mean_m = sum as f32 * share * self.metres_per_unit;
        // `most >= least`, but the compiler does not know and would branch on the overflow.
        let span_m = (f32::from(most) - f32::from(least)) * self.metres_per_unit;
        let is_measured =
            (least > 0) & (most < u16::MAX) & (f32::from(most) * self.metres_per_unit <= self.max_depth_m);
        let is_one_surface = span_m <= 4.0 * self.noise.sigma_m(mean_m);
        // An offset that leaves nothing in front of the camera leaves no measurement either.
        let depth_m = mean_m + self.depth_offset_m;
        if is_measured & is_one_surface & (depth_m > 0.0) { depth_m } else { 0.0 }
    }

    /// The depth of any cell, whole or with holes, at an edge or not. `rows` starts at the cell's
    /// first row and column; `size` is that of the cell, smaller than `n x n` at the image's end.
    #[inline(always)]
    pub(crate) fn measure(&self, rows: &[u16], width: usize, size: (usize, usize)) -> Option<CellDepth> {
        let at = |&(r, c): &(u8, u8)| {
            let (r, c) = (usize::from(r), usize::from(c));
            if r < size.0 && c < size.1 { rows[r * width + c] } else { 0 }
        };
        let reference = self.order.iter().find(|place| self.is_measured(at(place)))?;
        let reference_m = f32::from(at(reference)) * self.metres_per_unit;
        if self.variant.is_paper() {
            let (row, column) = (f32::from(reference.0), f32::from(reference.1));
            return self.corrected(reference_m, row, column);
        }
        // The surface in the cell's middle decides; the others do not pull on it.
        let tolerance = 2.0 * self.noise.sigma_m(reference_m) / self.metres_per_unit;
        let middle = f32::from(at(reference));
        let (low, high) = ((middle - tolerance).max(1.0) as u16, (middle + tolerance).min(65_534.0) as u16);
        let Sums { sum, n, sum_row, sum_column } = match size {
            // Their loops have fixed ends, which makes them twice as fast.
            (4, 4) if self.step == 4 => Sums::between(low, high, rows, width, (4, 4)),
            (8, 8) if self.step == 8 => Sums::between(low, high, rows, width, (8, 8)),
            _ => Sums::between(low, high, rows, width, size),
        };
        let share = 1.0 / n.max(1) as f32;
        let depth_m = sum as f32 * share * self.metres_per_unit;
        self.corrected(depth_m, sum_row as f32 * share, sum_column as f32 * share)
    }

    /// A measurement with the camera's depth offset added; none where that leaves it behind the camera.
    #[inline(always)]
    fn corrected(&self, measured_m: f32, row: f32, column: f32) -> Option<CellDepth> {
        let depth_m = measured_m + self.depth_offset_m;
        (depth_m > 0.0).then_some(CellDepth { depth_m, row, column })
    }

    #[inline(always)]
    fn is_measured(&self, raw: u16) -> bool {
        (raw > 0) & (raw <= self.largest)
    }
}

/// The largest raw depth, below that which marks an overflow, that is no farther than `max_depth_m`; 0 where
/// none is.
fn largest(metres_per_unit: f32, max_depth_m: f32) -> u16 {
    // Products rise with the raw depth, rounded or not.
    let (mut near, mut far) = (0, u16::MAX);
    while far - near > 1 {
        let middle = near.midpoint(far);
        *(if f32::from(middle) * metres_per_unit <= max_depth_m { &mut near } else { &mut far }) = middle;
    }
    near
}

/// Depths of one surface in a cell, and where they lie in it.
#[derive(Default)]
struct Sums {
    sum: u32,
    n: u32,
    sum_row: u32,
    sum_column: u32,
}

impl Sums {
    #[inline(always)]
    fn between(low: u16, high: u16, rows: &[u16], width: usize, size: (usize, usize)) -> Self {
        let mut sums = Self::default();
        for r in 0..size.0 {
            let row = &rows[r * width..r * width + size.1];
            for c in 0..size.1 {
                let here = u32::from((row[c] >= low) & (row[c] <= high));
                sums.sum += here * u32::from(row[c]);
                sums.n += here;
                sums.sum_row += here * r as u32;
                sums.sum_column += here * c as u32;
            }
        }
        sums
    }
}

/// The pixels of a cell in the order in which they may stand for it: the corner alone, or all by
/// distance from the middle, rows first among equals.
fn order(step: usize, variant: MethodVariant) -> Vec<(u8, u8)> {
    if variant.is_paper() {
        return vec![(0, 0)];
    }
    let place = step - 1;
    let mut order: Vec<(usize, (u8, u8))> = (0..step * step)
        .map(|i| (i / step, i % step))
        .map(|(r, c)| {
            let (dr, dc) = ((2 * r).abs_diff(place), (2 * c).abs_diff(place));
            (dr * dr + dc * dc, (r as u8, c as u8))
        })
        .collect();
    order.sort_unstable();
    order.into_iter().map(|(_, place)| place).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rule(variant: MethodVariant) -> CellRule {
        let camera = Camera::pinhole((16, 16), [525.0, 525.0, 8.0, 8.0], 1000.0);
        CellRule::new(&camera, 4, variant, 8.0, DepthNoise::default())
    }

    #[test]
    fn a_hole_at_the_corner_costs_the_vertex_only_by_the_corner_rule() {
        let mut depth = vec![1000u16; 256];
        depth[0] = 0;
        assert_eq!(rule(MethodVariant::Paper).measure(&depth, 16, (4, 4)), None);
        let mean = rule(MethodVariant::Tessera).measure(&depth, 16, (4, 4)).unwrap();
        // Fifteen pixels: the mean pixel is a little below and right of the middle.
        assert!((mean.depth_m - 1.0).abs() < 1e-6 && (mean.row - 1.6).abs() < 1e-6);
    }

    #[test]
    fn depths_are_not_averaged_across_an_edge() {
        let mut depth = vec![1000u16; 256];
        for row in 0..16 {
            depth[row * 16 + 3] = 2000;
        }
        let mean = rule(MethodVariant::Tessera);
        assert!((mean.measure(&depth, 16, (4, 4)).unwrap().depth_m - 1.0).abs() < 1e-6);
        assert_eq!(mean.whole_mean(1000, 2000, 12 * 1000 + 4 * 2000), 0.0);
        assert_eq!(mean.whole_mean(0, 1000, 15 * 1000), 0.0, "a hole is no whole cell");
        assert_eq!(mean.whole_mean(1000, u16::MAX, 15 * 1000), 0.0);
    }
}
