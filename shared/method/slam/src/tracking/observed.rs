//! A frame's feature matches at the relative poses of its surfaces, by which colour is audited.

use crate::estimation::colour_model::ColourRecord;
use tessera_features::Correspondence;
use tessera_geometry::{Camera, Pose};

/// One frame's sums over its pairs of images.
#[derive(Default)]
pub(crate) struct Observed {
    n_matches: u32,
    /// Of each pair.
    medians_px: Vec<f64>,
    nats: Vec<f64>,
}

impl Observed {
    /// Adds the matches of a pair whose relative pose is known, with what they tell for colour.
    pub(crate) fn add(
        &mut self,
        camera: &Camera,
        matches: &[Correspondence],
        target_from_query: &Pose,
        nats: Option<f64>,
    ) {
        let residuals = matches.iter().filter_map(|c| residual_px(camera, c, target_from_query));
        let mut residuals: Vec<f64> = residuals.collect();
        self.n_matches += residuals.len() as u32;
        if !residuals.is_empty() {
            let middle = residuals.len() / 2;
            self.medians_px.push(*residuals.select_nth_unstable_by(middle, f64::total_cmp).1);
        }
        self.nats.extend(nats);
    }

    /// The frame's record; none without a pair.
    pub(crate) fn record(self) -> Option<ColourRecord> {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        (!self.medians_px.is_empty() && !self.nats.is_empty()).then(|| ColourRecord {
            n_pairs: self.n_matches,
            residual_px: mean(&self.medians_px),
            nats: mean(&self.nats),
        })
    }
}

/// How far a match is from where the pose puts it in the image, pixels.
fn residual_px(camera: &Camera, c: &Correspondence, target_from_query: &Pose) -> Option<f64> {
    let b = target_from_query * nalgebra::Point3::from(c.query.point.as_ref()?.position_m);
    let [x, y] = c.target.ray;
    (b.z > 0.1).then(|| libm::hypot(b.x / b.z - x, b.y / b.z - y) * camera.focal_px())
}
