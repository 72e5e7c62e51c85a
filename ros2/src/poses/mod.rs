//! Poses of the run as the network has them.

pub(crate) mod base;
pub(crate) mod output;
mod path;
