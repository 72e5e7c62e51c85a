//! One file for each command.

mod completions;
mod evaluate;

pub(crate) use completions::completions;
pub(crate) use evaluate::evaluate;
