//! Settings of the three steps, with their defaults.

use serde::{Deserialize, Serialize};

/// A setting outside its range.
#[derive(Clone, Debug, PartialEq)]
pub struct RangeError {
    /// Key inside its table.
    pub key: &'static str,
    /// What was found.
    pub found: f64,
    /// Least and largest value.
    pub range: [f64; 2],
}

impl std::fmt::Display for RangeError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { key, found, range: [low, high] } = self;
        write!(f, "{key} is {found}, expected a number from {low} to {high}")
    }
}

impl std::error::Error for RangeError {}

/// Written so that NaN fails.
fn check_all(values: &[(&'static str, f64, f64, f64)]) -> Result<(), RangeError> {
    match values.iter().find(|(_, found, low, high)| !(found >= low && found <= high)) {
        Some(&(key, found, low, high)) => Err(RangeError { key, found, range: [low, high] }),
        None => Ok(()),
    }
}

/// Settings of [`crate::extract`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct FeatureSettings {
    /// Features per image at most.
    pub max_features: u32,
    /// Levels of the pyramid: scales 1, 1.5, 2, 3, 4, 6, 8, 12.
    pub levels: u32,
    /// FAST threshold, grey levels.
    pub threshold: u8,
    /// FAST threshold in cells without a corner at `threshold`, grey levels.
    pub low_threshold: u8,
    /// Side of the square cells that share the features of a level, pixels of the level.
    pub cell_px: u32,
    /// Standard deviation of a corner's position, pixels of its level.
    pub sigma_px: f32,
}

impl Default for FeatureSettings {
    fn default() -> Self {
        Self { max_features: 400, levels: 4, threshold: 20, low_threshold: 7, cell_px: 48, sigma_px: 1.0 }
    }
}

impl FeatureSettings {
    /// Checks every range, NaN included.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the range.
    pub fn check(&self) -> Result<(), RangeError> {
        check_all(&[
            ("max_features", self.max_features.into(), 0.0, 10_000.0),
            ("levels", self.levels.into(), 1.0, 8.0),
            ("threshold", self.threshold.into(), 1.0, 254.0),
            ("low_threshold", self.low_threshold.into(), 1.0, self.threshold.into()),
            ("cell_px", self.cell_px.into(), 8.0, 512.0),
            ("sigma_px", self.sigma_px.into(), 0.01, 100.0),
        ])
    }
}

/// Settings of [`crate::match_features`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MatchSettings {
    /// Hamming distance of a match at most, of 256 bits.
    pub max_distance: u32,
    /// Ratio test (Lowe 2004): the distance is below this times that of the second nearest target
    /// elsewhere in the image; 1 switches it off.
    pub max_ratio: f32,
    /// Targets within this of the nearest, along rows and columns, are the same corner on another
    /// level and do not count as second nearest, pixels of the full image.
    pub same_corner_px: f32,
    /// Difference of pyramid levels at most.
    pub max_level_difference: u32,
}

impl Default for MatchSettings {
    fn default() -> Self {
        Self { max_distance: 70, max_ratio: 0.8, same_corner_px: 5.0, max_level_difference: 8 }
    }
}

impl MatchSettings {
    /// Checks every range, NaN included.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the range.
    pub fn check(&self) -> Result<(), RangeError> {
        check_all(&[
            ("max_distance", self.max_distance.into(), 0.0, 256.0),
            ("max_ratio", self.max_ratio.into(), 0.1, 1.0),
            ("same_corner_px", self.same_corner_px.into(), 0.0, 100.0),
            ("max_level_difference", self.max_level_difference.into(), 0.0, 8.0),
        ])
    }
}

/// Settings of [`crate::estimate_pose`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PoseSettings {
    /// RANSAC iterations at most.
    pub max_iterations: u32,
    /// Probability that one all-inlier sample was drawn when RANSAC ends early.
    pub confidence: f64,
    /// Normalised error of an inlier at most, standard deviations.
    pub inlier_sigmas: f64,
    /// Inliers at least.
    pub min_inliers: u32,
    /// Iterations of the refinement at most.
    pub refine_iterations: u32,
    /// Degenerate beyond: standard deviation of the translation in any direction, metres.
    pub max_translation_sigma_m: f64,
    /// Degenerate beyond: standard deviation of the rotation about any axis, radians.
    pub max_rotation_sigma_rad: f64,
}

impl Default for PoseSettings {
    fn default() -> Self {
        Self {
            max_iterations: 200,
            confidence: 0.999,
            inlier_sigmas: 3.0,
            min_inliers: 8,
            refine_iterations: 8,
            max_translation_sigma_m: 0.1,
            max_rotation_sigma_rad: 0.03,
        }
    }
}

impl PoseSettings {
    /// Checks every range, NaN included.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the range.
    pub fn check(&self) -> Result<(), RangeError> {
        check_all(&[
            ("max_iterations", self.max_iterations.into(), 0.0, 100_000.0),
            ("confidence", self.confidence, 0.5, 1.0 - 1e-9),
            ("inlier_sigmas", self.inlier_sigmas, 0.5, 10.0),
            ("min_inliers", self.min_inliers.into(), 4.0, 1000.0),
            ("refine_iterations", self.refine_iterations.into(), 1.0, 100.0),
            ("max_translation_sigma_m", self.max_translation_sigma_m, 1e-4, 100.0),
            ("max_rotation_sigma_rad", self.max_rotation_sigma_rad, 1e-4, 10.0),
        ])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_hold_and_nonsense_is_named() {
        FeatureSettings::default().check().unwrap();
        MatchSettings::default().check().unwrap();
        PoseSettings::default().check().unwrap();
        let bad = FeatureSettings { low_threshold: 30, ..FeatureSettings::default() };
        assert_eq!(
            bad.check().unwrap_err().to_string(),
            "low_threshold is 30, expected a number from 1 to 20"
        );
        let bad = PoseSettings { inlier_sigmas: f64::NAN, ..PoseSettings::default() };
        assert_eq!(bad.check().unwrap_err().key, "inlier_sigmas");
        let bad = MatchSettings { max_ratio: f32::NAN, ..MatchSettings::default() };
        assert_eq!(bad.check().unwrap_err().key, "max_ratio");
    }
}
