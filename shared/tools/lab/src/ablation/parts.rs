//! What the parts beside the paper's are worth: the whole system without each of them.

use serde::Serialize;
use tessera_settings::Settings;

/// The whole system without a part.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Part {
    /// The part that is left out.
    pub without: &'static str,
    /// `key=value`, over the whole system's settings.
    pub overrides: &'static [&'static str],
    /// What no key turns.
    #[serde(skip)]
    pub(super) change: fn(&mut Settings),
}

/// All parts, features first.
pub(super) const PARTS: [Part; 5] = [
    Part::of_keys("features", &["mapping.features.enabled=false"]),
    Part::of_change("initial guesses from features", |s| s.mapping.features.gives_guess = false),
    Part::of_keys("correction of lag and focal ratio", &["mapping.features.correct=false"]),
    Part::of_change("leaving out what moves", |s| s.mapping.window.at_rest_only = false),
    Part::of_keys("culling", &["mapping.keyframe.redundant_within_m=0"]),
];

impl Part {
    const fn of_keys(without: &'static str, overrides: &'static [&'static str]) -> Self {
        Self { without, overrides, change: |_| () }
    }

    const fn of_change(without: &'static str, change: fn(&mut Settings)) -> Self {
        Self { without, overrides: &[], change }
    }
}
