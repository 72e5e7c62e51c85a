//! Tracking: one frame against a local window of fixed poses (III-F), and the keyframe test (III-H).

pub(crate) mod acceptance;
pub(crate) mod alignment;
pub(crate) mod alike;
pub(crate) mod audit;
#[cfg(test)]
mod colour_tests;
pub(crate) mod covariance;
pub(crate) mod degeneracy;
pub(crate) mod fixed_lag;
pub(crate) mod found_place;
pub(crate) mod frame_record;
pub(crate) mod hypotheses;
pub(crate) mod in_place;
pub(crate) mod input;
pub(crate) mod keyframe_test;
pub(crate) mod motion_model;
pub(crate) mod observed;
pub(crate) mod passing;
pub(crate) mod prediction;
pub(crate) mod promotion;
pub(crate) mod relocalise;
pub(crate) mod rotation_hypothesis;
pub(crate) mod seen_pose;
pub(crate) mod sight;
pub(crate) mod start;
pub(crate) mod trees;
pub(crate) mod trigger;
pub(crate) mod turn;
pub(crate) mod upright;
pub(crate) mod window;
pub(crate) mod window_alignment;
pub(crate) mod window_association;
pub(crate) mod workload;
