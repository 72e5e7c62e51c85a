//! One file for each command.

mod completions;
mod evaluate;
mod export;
mod run;
mod stage;

pub(crate) use completions::completions;
pub(crate) use evaluate::evaluate;
pub(crate) use export::export;
pub(crate) use run::run;
pub(crate) use stage::stage;
