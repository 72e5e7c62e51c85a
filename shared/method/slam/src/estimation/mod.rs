//! Estimates while a run goes on: noise scales, the camera's motion, and the colour model.

pub(crate) mod colour_model;
pub(crate) mod colour_pose;
pub(crate) mod motion_filter;
pub(crate) mod noise_scales;
pub(crate) mod readout;
pub(crate) mod student;
