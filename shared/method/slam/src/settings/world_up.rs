//! Which way up the world is.

use serde::{Deserialize, Serialize};

/// Axes of the world.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum WorldUp {
    /// Those of the first image.
    #[default]
    Camera,
    /// With y along gravity, by an accelerometer; where there is none, by the floor that the first image shows.
    Gravity,
}

impl WorldUp {
    /// Whether the world is levelled.
    pub fn is_gravity(self) -> bool {
        self == Self::Gravity
    }
}
