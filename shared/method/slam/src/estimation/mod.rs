//! Estimates while a run goes on: noise scales, the camera's motion, and the colour model.

/// Bound of the squared distance of what agrees: for two poses the chi-square of six dimensions at an error rate of one
/// in a thousand, the rate at which poses that agree are refused.
pub(crate) const CHI_SQUARE_6: f64 = 22.458;
/// Share of frames, or of looks, at which what is right is given up, at most.
pub(crate) const FALSE_ALARMS: f64 = 2e-3;
/// Rate at which what is right is missed.
pub(crate) const MISSED: f64 = 1e-2;
/// Share by which what was seen before counts less with each frame that tells something: a memory of 100.
const FORGETTING: f64 = 0.01;

pub(crate) mod colour_model;
pub(crate) mod colour_pose;
pub(crate) mod motion_filter;
pub(crate) mod noise_scales;
pub(crate) mod readout;
pub(crate) mod student;
