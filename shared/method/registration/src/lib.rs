//! Surface-to-surface alignment of organised surfaces with many edges at once.
//!
//! [`Sampler`] draws the queries of a frame, [`Matcher`] finds their partners on another surface,
//! rejects outliers and sums the generalised ICP term of a pair (eq. 10-13): the exact sufficient
//! statistics of its correspondences, which `tessera_graph` solves.
#![forbid(unsafe_code)]

mod association;
mod gicp;
mod sampling;
mod settings;

pub use association::{
    FreeSpaceView, GridCamera, KdTree, Match, MatchLimits, Matcher, PairReport, Queries, ReadoutSums,
    Selection, ShutterTable, Target, mark_free_space,
};
pub use sampling::{Sample, Sampler, gather};
pub use settings::RegistrationSettings;
