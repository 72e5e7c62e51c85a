//! Intrinsics that follow a phone's autofocus, at any size of its images.

use nalgebra::Vector4;

/// Share of the focal length by which autofocus may change it without a word.
const MOST_FOCUS_CHANGE: f64 = 0.01;

/// `fx fy cx cy` over the columns and rows of the images.
pub(super) struct Intrinsics {
    /// Over the frames, each value by itself.
    median: Vector4<f64>,
    /// By how much of itself the focal length changes.
    focus_change: f64,
}

impl Intrinsics {
    /// From `fx fy cx cy` of each frame with columns and rows of its image; zeros where there is none.
    pub(super) fn of(frames: impl IntoIterator<Item = ([f64; 4], (u32, u32))>) -> Self {
        let shares: Vec<Vector4<f64>> = frames
            .into_iter()
            .map(|(intrinsics, size)| Vector4::from(intrinsics).component_div(&per(size)))
            .collect();
        let sorted = |at: usize| {
            let mut values: Vec<f64> = shares.iter().filter_map(|share| share.get(at).copied()).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let median = Vector4::from_fn(|at, _| sorted(at).get(shares.len() / 2).copied().unwrap_or_default());
        let focal = sorted(0);
        let range = focal.first().zip(focal.last()).map_or(0.0, |(least, most)| most - least);
        Self { median, focus_change: range / median.x }
    }

    /// `fx fy cx cy` at a size of the images, pixels.
    pub(super) fn at(&self, size: (u32, u32)) -> [f64; 4] {
        self.median.component_mul(&per(size)).into()
    }

    pub(super) fn warning(&self) -> Option<String> {
        (self.focus_change > MOST_FOCUS_CHANGE).then(|| {
            let percent = 100.0 * self.focus_change;
            format!(
                "the focal length changes by {percent:.1} % (autofocus): its median is used for all frames"
            )
        })
    }
}

/// What `fx fy cx cy` are counted by.
fn per((width, height): (u32, u32)) -> Vector4<f64> {
    let (w, h) = (f64::from(width), f64::from(height));
    Vector4::new(w, h, w, h)
}
