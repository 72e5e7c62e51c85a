//! What is estimated while a run goes on: scales of the noise, the camera's motion, and how colour lies against depth.

pub(crate) mod colour_model;
pub(crate) mod colour_pose;
pub(crate) mod motion_filter;
pub(crate) mod noise_scales;
