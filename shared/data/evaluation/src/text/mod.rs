//! Trajectories and times as text.
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

pub(crate) mod file;
pub(crate) mod forms;
pub(crate) mod nerf;
pub(crate) mod plain;
pub(crate) mod stamp;
