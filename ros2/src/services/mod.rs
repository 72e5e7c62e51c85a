//! What the network can ask of the run.

pub(crate) mod initial_pose;
pub(crate) mod parameters;
pub(crate) mod relocalise;
pub(crate) mod save;
pub(crate) mod trigger;
