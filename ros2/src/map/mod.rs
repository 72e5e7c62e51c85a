//! The map of a run as the network has it. Where keyframes stand is read from the run's directory by
//! a thread of its own; nothing of this is a part of the run.

mod cloud;
mod follow;
mod grid;
mod live_verdict;
mod making;
mod mapper;
mod pace;
mod saved;
mod side;
mod worker;

pub(crate) use saved::save_grid;
pub(crate) use side::MapSide;
pub(crate) use worker::MapOptions;
