//! One file for each command.

mod ablate;
mod beside;
mod calibrate;
mod chaos;
mod check;
mod clean;
mod completions;
mod evaluate;
mod export;
mod external;
mod metrics;
mod profile;
mod record;
mod report;
mod resume;
mod run;
mod stage;
mod status;
mod top;

pub(crate) use ablate::ablate;
pub(crate) use calibrate::calibrate;
pub(crate) use chaos::chaos;
pub(crate) use check::check;
pub(crate) use clean::clean;
pub(crate) use completions::completions;
pub(crate) use evaluate::evaluate;
pub(crate) use export::{export, say_summary};
pub(crate) use profile::profile;
pub(crate) use record::record;
pub(crate) use report::report;
pub(crate) use resume::resume;
pub(crate) use run::run;
pub(crate) use stage::stage;
pub(crate) use status::status;
pub(crate) use top::top;
