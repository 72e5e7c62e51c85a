//! The supervisor: it alone starts the stages, notices their death, cleans up and starts them again.
//!
//! It holds no state that a run needs: what has happened is in the run directory, and a killed
//! supervisor is replaced by another one (`tessera resume`).

mod failure;
mod hold;
mod limits;
mod marks;
mod outcome;
mod plan;
mod policy;
mod saved_map;
mod signals;
mod stage_process;
mod tally;
mod watch;
mod watched;

pub(crate) use failure::SupervisorError;
pub(crate) use hold::hold;
pub(crate) use outcome::{Outcome, Progress, Supervised};
pub(crate) use plan::Plan;
pub(crate) use saved_map::update_map;
pub(crate) use stage_process::run_stage;
pub(crate) use tally::Counters;
pub(crate) use watch::supervise;
