//! Two views: features and surfaces matched, aligned to each other, and tested.

pub(crate) mod colour_coupling;
pub(crate) mod colour_evidence;
pub(crate) mod covisibility;
pub(crate) mod feature_cache;
pub(crate) mod keyframe_pair;
pub(crate) mod lift;
pub(crate) mod match_cache;
pub(crate) mod matchable;
pub(crate) mod matching;
pub(crate) mod noise_evidence;
pub(crate) mod pair_alignment;
pub(crate) mod residuals;
pub(crate) mod seen_focal;
pub(crate) mod verification;
pub(crate) mod weighted_pair;
