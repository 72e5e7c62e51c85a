//! Maps of several runs in one.

pub(crate) mod joint;
pub(crate) mod joint_cache;
pub(crate) mod known_looks;
mod looked_again;
pub(crate) mod meeting;
