//! Sparse features of an image, data association by descriptor, and a robust relative pose.
//!
//! The surface alone does not determine the pose in front of walls and along corridors, and a
//! frame-to-frame step outside the basin of convergence ends in a wrong minimum. Corners of the
//! image fix both. Three steps, each usable alone:
//!
//! 1. [`extract`]: oriented FAST corners with rotated binary descriptors on an image pyramid,
//!    spread over the image (Rublee et al. 2011, "ORB: an efficient alternative to SIFT or SURF").
//! 2. [`match_features`]: mutual nearest neighbours by Hamming distance with a ratio test,
//!    optionally gated by a predicted pixel.
//! 3. [`estimate_pose`]: RANSAC over 3D-3D and 2D-3D minimal sets (Fischler and Bolles 1981), then
//!    iteratively reweighted least squares, with the 6x6 information of the result.
//!
//! The same input gives the same bits on every machine and for every instruction set: integer
//! arithmetic in images, fixed order in sums, elementary functions from `libm`, seeds from the
//! caller.
#![forbid(unsafe_code)]

mod descriptor;
mod detect;
mod extract;
mod extractor;
mod fast;
mod feature;
mod focal;
mod gate;
mod matching;
mod patch;
mod pattern;
mod picture;
mod place_index;
mod pose;
mod pyramid;
mod settings;
mod sorted_runs;
mod spread;

pub use extract::{ExtractWorkspace, extract};
pub use extractor::Extractor;
pub use feature::Feature;
pub use focal::{FocalRatio, ViewPair, focal_ratio};
pub use gate::Gate;
pub use matching::{FeatureMatch, MatchWorkspace, hamming_distance, match_features};
pub use picture::{Picture, PictureError, Pixels};
pub use place_index::{PlaceIndex, PlaceMatch};
pub use pose::{Correspondence, Observation, PointEstimate, PoseEstimate, PoseWorkspace, estimate_pose};
pub use settings::{FeatureSettings, MatchSettings, PoseSettings, RangeError};
