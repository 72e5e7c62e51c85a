//! The one map of all runs that a base has copied, and its answers to the requests of single runs.

pub mod answer;
pub mod joint;
mod past;
mod received;
pub(crate) mod scene;
pub mod summary;
mod surfaces;
