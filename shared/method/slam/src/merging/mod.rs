//! Maps of several runs in one.

pub(crate) mod joint;
pub(crate) mod joint_cache;
pub(crate) mod known_looks;
pub(crate) mod meeting;
