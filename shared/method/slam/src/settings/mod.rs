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
use tessera_numerics::SettingError;
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
}

impl MappingSettings {
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
