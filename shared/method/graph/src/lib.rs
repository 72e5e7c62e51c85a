//! The multi-edge graph of Holz and Behnke 2015, III-E: poses as vertices, and between two poses
//! one edge for each point correspondence (eq. 12 and 13).
//!
//! All correspondences of a pair are one [`PairBlock`]: their exact sufficient statistics. A
//! [`Graph`] of poses and pair blocks is solved by Levenberg-Marquardt ([`Graph::optimise`]) with
//! its pairs frozen. [`MultiEdge::solve`] is the outer loop around it, which searches the pairs
//! again under shrinking limits: one optimiser for the local window, loop
//! verification and all keyframes at once.
#![forbid(unsafe_code)]

mod assemble;
mod block;
mod costs;
mod graph;
mod lean;
mod levenberg;
mod linearised;
mod multi_edge;
mod robust;
mod solve;
mod statistics;
mod up;

pub use block::{BlockSums, HalfSums, PairBlock, Quadratic};
pub use graph::{Graph, InnerReport, Pair, Prior, Solver};
pub use multi_edge::{DataAssociation, INNER_ITERATIONS, MultiEdge, OuterIteration, Schedule, Solved};
pub use robust::{GemanMcClure, disagreement_sigmas, own_cost};
pub use statistics::{covariance_from_information, entropy_of_covariance, metric_covariance};
pub use tessera_numerics::NotPositiveDefinite;
pub use up::{Up, Ups};
