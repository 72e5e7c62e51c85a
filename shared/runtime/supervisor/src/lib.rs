//! The supervisor: it alone starts the stages, notices their death, cleans up and starts them again.
//!
//! It holds no state that a run needs: what has happened is in the run directory, and a killed
//! supervisor is replaced by another one (`tessera resume`).
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

mod failure;
mod hold;
mod limits;
mod marks;
mod outcome;
mod plan;
mod policy;
mod recorded;
mod saved_map;
mod signals;
mod stage_process;
mod tally;
mod watch;
mod watched;

pub use failure::SupervisorError;
pub use hold::hold;
pub use outcome::{MapCounts, Progress, RunOutcome, Supervised};
pub use plan::Plan;
pub use saved_map::{LoadedMap, load_map, update_map};
pub use stage_process::LIFELINE_VARIABLE;
pub use tally::Counters;
pub use watch::supervise;
