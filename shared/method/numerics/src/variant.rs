//! Whose variant of an algorithm runs: ours, or the paper's.

use serde::{Deserialize, Serialize};

/// What the preset `paper` turns, of each crate of the method at once; the pages of the method name both values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MethodVariant {
    /// What has the smaller error.
    #[default]
    Tessera,
    /// That of Holz and Behnke (ECMR 2015).
    Paper,
}

impl MethodVariant {
    /// Whether it is the paper's.
    pub fn is_paper(self) -> bool {
        self == Self::Paper
    }
}
