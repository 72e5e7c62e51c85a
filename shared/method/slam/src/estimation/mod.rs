//! Estimates while a run goes on: noise scales, the camera's motion, and the colour model.

/// Share by which what was seen before counts less with each frame that tells something: a memory of 100.
const FORGETTING: f64 = 0.01;

pub(crate) mod colour_model;
pub(crate) mod colour_pose;
pub(crate) mod motion_filter;
pub(crate) mod noise_scales;
pub(crate) mod readout;
pub(crate) mod student;
