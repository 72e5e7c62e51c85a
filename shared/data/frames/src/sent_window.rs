//! Binning and region of interest of ROS's CameraInfo, whose other numbers are those of the whole image.

/// What of a camera's image is sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SentWindow {
    /// Columns and rows that were combined into one; 0 is 1.
    pub binning: [u32; 2],
    /// First column and row of the region, before binning.
    pub first: [u32; 2],
    /// Columns and rows of the region, before binning; where one is 0, the whole image.
    pub size: [u32; 2],
}

impl SentWindow {
    fn region(&self) -> ([u32; 2], Option<[u32; 2]>) {
        if self.size.contains(&0) { ([0, 0], None) } else { (self.first, Some(self.size)) }
    }

    /// Columns and rows of the images, and their `fx fy cx cy`, of those of the whole image.
    ///
    /// Binning takes the mean of its pixels, so edges stay where they are: the first is at -0.5.
    pub fn of(&self, whole: (u32, u32), [fx, fy, cx, cy]: [f64; 4]) -> ((u32, u32), [f64; 4]) {
        let ([left, top], size) = self.region();
        let [width, height] = size.unwrap_or([whole.0, whole.1]);
        let [n, m] = self.binning.map(|n| n.max(1));
        let (x, y) = (f64::from(n), f64::from(m));
        let centre = |c: f64, first: u32, n: f64| (c - f64::from(first) + 0.5) / n - 0.5;
        let size = (width.checked_div(n).unwrap_or(0), height.checked_div(m).unwrap_or(0));
        (size, [fx / x, fy / y, centre(cx, left, x), centre(cy, top, y)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_is_cut_and_then_binned() {
        let whole = [600.0, 610.0, 319.5, 239.5];
        let of = |binning, first, size| SentWindow { binning, first, size }.of((640, 480), whole);
        assert_eq!(of([0, 0], [0, 0], [0, 0]), ((640, 480), whole));
        assert_eq!(of([1, 1], [0, 0], [640, 480]), ((640, 480), whole));
        assert_eq!(of([2, 2], [0, 0], [0, 0]), ((320, 240), [300.0, 305.0, 159.5, 119.5]));
        assert_eq!(of([0, 0], [80, 60], [320, 240]), ((320, 240), [600.0, 610.0, 239.5, 179.5]));
        assert_eq!(of([2, 4], [80, 60], [320, 240]), ((160, 60), [300.0, 152.5, 119.5, 44.5]));
    }
}
