//! Surface-to-surface alignment of organised surfaces with many edges at once.
//!
//! A pair of frames is one [`PairBlock`]: the exact sufficient statistics of all its
//! correspondences (SPEC 5.3-5.4). A [`Graph`] of poses and pair blocks is solved by
//! Levenberg-Marquardt ([`Graph::optimise`]), whether it is one new frame against a fixed
//! window or all keyframes at once: one engine for both, as in Holz and Behnke 2015, III-E.
#![forbid(unsafe_code)]

mod accumulate;
mod assemble;
mod block;
mod brightness;
mod candidates;
mod cholesky;
mod columns;
mod descent;
mod elimination;
mod found;
mod graph;
mod kd_tree;
mod lanes;
mod levenberg;
mod linearised;
mod locate;
mod matches;
mod matching;
mod projection;
mod queries;
mod random;
mod sampling;
mod settings;
mod solve;
mod statistics;
mod target;

pub use block::{BlockSums, PairBlock};
pub use graph::{Graph, InnerReport, Pair, Prior, Solver};
pub use kd_tree::KdTree;
pub use matches::Match;
pub use matching::{MatchLimits, Matcher, PairReport};
pub use projection::GridCamera;
pub use queries::{Queries, Selection};
pub use random::SplitMix64;
pub use sampling::{Sample, Sampler, gather};
pub use settings::{BrightnessUse, RegistrationSettings, SearchMethod, SearchSettings, WeightSettings};
pub use solve::NotPositiveDefinite;
pub use statistics::{covariance_from_information, entropy_of_covariance, metric_covariance};
pub use target::{ShutterTable, Target};
