//! What a source may have wrong before a run refuses it.

use serde::{Deserialize, Serialize};

/// Recordings with flaws.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SourceSettings {
    /// Largest share of frames with a missing or broken image, 0 to 1: each is named and counted, and the
    /// run goes on without the image. 0: the first one ends the run. Above 0, one frame is always borne.
    pub max_broken_share: f64,
}

impl Default for SourceSettings {
    fn default() -> Self {
        Self { max_broken_share: 0.05 }
    }
}

impl SourceSettings {
    /// Checks the range; NaN is outside.
    ///
    /// # Errors
    /// `key is value, expected rule`.
    pub fn check(&self) -> Result<(), String> {
        match (0.0..=1.0).contains(&self.max_broken_share) {
            true => Ok(()),
            false => {
                Err(format!("max_broken_share is {}, expected a number from 0 to 1", self.max_broken_share))
            }
        }
    }

    /// Frames with a broken image that a source of `n_frames` may have.
    #[expect(clippy::cast_possible_truncation, reason = "a share of a count is a count")]
    pub fn most_broken(&self, n_frames: u64) -> u64 {
        match self.max_broken_share > 0.0 {
            true => ((self.max_broken_share * n_frames as f64) as u64).max(1),
            false => 0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_bears_one_frame_unless_it_is_zero() {
        let most = |share, n| SourceSettings { max_broken_share: share }.most_broken(n);
        assert_eq!((most(0.05, 400), most(0.05, 10), most(0.0, 400), most(1.0, 7)), (20, 1, 0, 7));
        assert!(SourceSettings { max_broken_share: f64::NAN }.check().is_err());
    }
}
