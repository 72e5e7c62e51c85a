//! Submaps: where the camera leaves its map, and which maps are of one place.

pub(crate) mod brought_together;
pub(crate) mod contradiction;
pub(crate) mod departure;
pub(crate) mod join;
pub(crate) mod submap;
