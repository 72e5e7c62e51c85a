//! The camera's parameters from its own frames: no target, no ground truth.
//!
//! A surface that is seen twice must be the same surface. A wrong focal length, principal point,
//! lens, readout time or depth offset deforms each frame in its own axes, so two frames that are
//! turned against each other disagree, and no poses make them agree. [`calibrate`] therefore solves
//! for all keyframe poses and the camera at once: the camera is a dense border of the pose graph's
//! sparse system, and what remains of it once the poses are eliminated (the Schur complement) shows
//! which combinations of parameters this motion determines. The others stay at their start: each
//! moves to the frames' estimate by the share that its standard deviation leaves.
//!
//! A global scale of depth is not among the unknowns: depth and all translations times a constant
//! fit the same frames equally well.
#![forbid(unsafe_code)]

mod calibrate;
mod derivative;
mod directions;
mod jackknife;
mod matching;
mod pairs;
mod parameters;
mod problem;
mod residuals;
mod sizes;
mod solution;
mod system;
mod warp;
mod widths;

pub use calibrate::calibrate;
pub use pairs::{PairLimits, pairs};
pub use parameters::{N_PARAMETERS, Parameter, Parameters};
pub use problem::{CalibrationKeyframe, Problem};
pub use solution::{Calibration, CalibrationError, Estimate, HeldDirection};
pub use warp::SurfaceWarp;
