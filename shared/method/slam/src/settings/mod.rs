//! Settings of tracking, keyframes, loops, relocalisation and the global optimisation.

mod features;
mod global;
mod keyframe;
mod loops;
mod relocalise;
mod submaps;
mod window;
mod world_up;

pub use features::FeatureUse;
pub use global::GlobalSettings;
pub use keyframe::KeyframeSettings;
pub use loops::LoopSettings;
pub use relocalise::RelocaliseSettings;
use serde::{Deserialize, Serialize};
pub use submaps::SubmapSettings;
use tessera_numerics::{MethodVariant, SettingError};
pub use window::WindowSettings;
pub use world_up::WorldUp;

/// All settings of mapping.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MappingSettings {
    /// Frames are tracked in the map of an earlier run, and nothing is added to it: no keyframe, no loop, no
    /// submap.
    pub only_localise: bool,
    /// Axes of the world: those of the first image, or levelled, with y down, by an accelerometer or by the floor.
    pub world_up: WorldUp,
    /// The local window.
    pub window: WindowSettings,
    /// Keyframes.
    pub keyframe: KeyframeSettings,
    /// Loops.
    #[serde(rename = "loop")]
    pub loops: LoopSettings,
    /// Lost and found.
    pub relocalise: RelocaliseSettings,
    /// Submaps.
    pub submaps: SubmapSettings,
    /// Global optimisation.
    pub global: GlobalSettings,
    /// Features.
    pub features: FeatureUse,
    /// Schedule of the window's alignment, and the entropy's part in the keyframe test.
    pub variant: MethodVariant,
}

impl MappingSettings {
    /// Outer iterations while tracking (method 5.1).
    pub(crate) fn outer_iterations(&self) -> u32 {
        if self.variant.is_paper() { 10 } else { 6 }
    }

    /// Bounds of the first distance limit while tracking, metres (method 5.1).
    pub(crate) fn first_distance_m(&self) -> [f64; 2] {
        if self.variant.is_paper() { [2.0, 2.0] } else { [0.1, 0.5] }
    }

    /// Checks every range, NaN included.
    ///
    /// # Errors
    /// Names the first key that is out of range, its value and the rule.
    pub fn check(&self) -> Result<(), SettingError> {
        self.window.check()?;
        self.keyframe.check()?;
        self.loops.check()?;
        self.relocalise.check()?;
        self.submaps.check()
    }
}
