//! A robust relative pose from matches of which many are wrong.

mod align;
mod correspondence;
mod estimate;
mod linearise;
mod p3p;
mod refine;
mod sample;
mod score;
#[cfg(test)]
mod tests;

pub use correspondence::{Correspondence, Observation, PointEstimate};
pub use estimate::{PoseEstimate, PoseWorkspace, estimate_pose};
