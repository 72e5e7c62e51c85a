//! Data association: for each query point the nearest target point, by projection or exactly, and
//! the rejection of pairs that do not belong together (III-I).

pub(crate) mod columns;
mod descent;
pub(crate) mod found;
mod free_space;
mod kd_tree;
mod limits;
mod matcher;
mod matches;
mod projection;
mod projective_search;
mod queries;
mod readout;
pub(crate) mod rejection;
mod target;

pub use free_space::{FreeSpaceView, mark_free_space};
pub use kd_tree::KdTree;
pub use limits::MatchLimits;
pub use matcher::{Matcher, PairReport};
pub use matches::Match;
pub use projection::GridCamera;
pub use queries::{Queries, Selection};
pub use readout::ReadoutSums;
pub use target::{ShutterTable, Target};
