//! One stage by itself: its exact input in a file, and the stage run on it with no other process.

mod align;
mod measure;
mod optimise;
mod reconstruct;
mod record;
mod recording;
mod report;

pub(crate) use measure::Options;
pub(crate) use record::record;
pub(crate) use recording::{Recorded, Stages};
pub(crate) use report::Report;

use crate::exit::CommandError;
use tessera_messages::Stage;

/// Runs the stage of a recording on it.
pub(crate) fn profile(recorded: &Recorded, options: &Options) -> Result<Report, CommandError> {
    match recorded.stage {
        Stage::Reconstruct => reconstruct::profile(recorded, options),
        Stage::Align => align::profile(recorded, options),
        _ => optimise::profile(recorded, options),
    }
}
