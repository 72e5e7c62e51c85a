//! One file for each command.

mod completions;
mod evaluate;
mod export;

pub(crate) use completions::completions;
pub(crate) use evaluate::evaluate;
pub(crate) use export::export;
