//! Noise scales of surfaces and features, as a run estimated them.

use serde::Serialize;
use tessera_slam::{NoiseRecord, NoiseScales, NoiseState};

/// Factors of the covariances that the models of the sensors state, at the end of a run, each with its standard
/// deviation (method 9.5).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct NoiseSummary {
    /// Of a relative pose from surfaces.
    pub surfaces: [f64; 2],
    /// Of a relative pose from features.
    pub features: [f64; 2],
}

impl NoiseSummary {
    /// The scales as of these records, in order of frames; `None` without any.
    pub fn new<'a>(records: impl IntoIterator<Item = &'a NoiseRecord>) -> Option<Self> {
        let state = NoiseState::of_records(records);
        let NoiseScales { surfaces, features } = state.scales();
        let [of_surfaces, of_features] = state.relative_deviations();
        (state != NoiseState::default()).then_some(Self {
            surfaces: [surfaces, surfaces * of_surfaces],
            features: [features, features * of_features],
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evidence_of_many_frames_outweighs_the_prior_and_narrows_it() {
        assert_eq!(NoiseSummary::new([]), None);
        let record = NoiseRecord {
            halves: [0.6, 6.0],
            squared: [1.5, 6.0],
            redundancy: [3.0, 3.0],
            ..NoiseRecord::default()
        };
        let few = NoiseSummary::new(&[record; 3]).unwrap();
        let many = NoiseSummary::new(&[record; 500]).unwrap();
        assert!((many.features[0] - 2.0).abs() < 0.1 && few.features[0] < 1.5, "{few:?} {many:?}");
        assert!((many.surfaces[0] - 0.5).abs() < 0.05, "{many:?}");
        assert!(many.features[1] / many.features[0] < 0.5 * few.features[1] / few.features[0]);
    }
}
