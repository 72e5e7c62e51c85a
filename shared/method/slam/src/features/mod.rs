//! Sparse features beside the surfaces: initial guesses, residuals, and whether colour may be
//! believed (method 14.2).

pub(crate) mod audit;
pub(crate) mod colour_model;
pub(crate) mod colour_pose;
pub(crate) mod lift;
pub(crate) mod matching;
pub(crate) mod observed;
pub(crate) mod residuals;
pub(crate) mod seen_focal;
pub(crate) mod sight;
pub(crate) mod start;
#[cfg(test)]
mod tests;
pub(crate) mod weighted_pair;
