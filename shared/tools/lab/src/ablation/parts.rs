//! What the parts beside the paper's are worth: the whole system without each of them.

use serde::Serialize;

/// The whole system without a part.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Part {
    /// The part that is left out.
    pub without: &'static str,
    /// `key=value`, over the whole system's settings.
    pub overrides: &'static [&'static str],
}

/// All parts, features first.
pub(super) const PARTS: [Part; 5] = [
    Part { without: "features", overrides: &["mapping.features.enabled=false"] },
    Part {
        without: "residuals of features (initial guesses alone)",
        overrides: &["mapping.features.weight=0"],
    },
    Part {
        without: "several starts on long strides",
        overrides: &["experiment.mapping.window.long_strides=false"],
    },
    Part { without: "correction of lag and focal ratio", overrides: &["mapping.features.correct=false"] },
    Part { without: "culling", overrides: &["mapping.keyframe.redundant_within_m=0"] },
];
