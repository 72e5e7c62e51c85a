//! Loop closure (III-G): candidates, verification, joins of submaps.

pub(crate) mod alike;
pub(crate) mod appearance;
pub(crate) mod brought_together;
pub(crate) mod contradiction;
pub(crate) mod covisibility;
pub(crate) mod detection;
pub(crate) mod feature_cache;
pub(crate) mod from_appearance;
pub(crate) mod in_place;
pub(crate) mod join;
pub(crate) mod keyframe_pair;
pub(crate) mod known_looks;
pub(crate) mod matchable;
pub(crate) mod meeting;
pub(crate) mod pair_alignment;
pub(crate) mod said_loops;
#[cfg(test)]
pub(crate) mod test_wall;
pub(crate) mod trigger;
pub(crate) mod verification;
pub(crate) mod view_limits;
