//! Many robots, one map, over Zenoh.
//!
//! On each robot an uplink follows a run directory and answers for its bytes; a base copies the run
//! directories of all robots and makes one map of them. The base asks, by offset: what it has on disk is
//! where it goes on, whatever dies in between. A run that leaves its optimisations to the base gets the
//! base's answers from its uplink; of other runs the uplink reads alone.
//!
//! Each folder knows those above it in this list alone, `chaos` the base too.
#![forbid(unsafe_code)]
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

pub mod arguments;
pub mod base;
#[expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "faults on purpose: what is read is of its own processes"
)]
pub mod chaos;
pub mod copies;
pub mod error;
pub mod looking;
#[expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "of records that `copies` has checked; numbers of runs and keyframes are the map's own"
)]
pub mod map;
pub mod robot;
pub mod wire;
