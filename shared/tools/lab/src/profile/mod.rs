//! One stage by itself: its exact input in a file, and the stage run on it with no other process.

mod align;
mod measure;
mod optimise;
mod reconstruct;
mod record;
mod recording;
mod report;

pub use measure::Options;
pub use record::record;
pub use recording::{Recorded, Stages};
pub use report::{ProfileReport, Times};

use tessera_messages::Stage;
use tessera_outputs::ToolError;

/// Runs the stage of a recording on it.
pub fn profile(recorded: &Recorded, options: &Options) -> Result<ProfileReport, ToolError> {
    match recorded.stage {
        Stage::Reconstruct => reconstruct::profile(recorded, options),
        Stage::Align => align::profile(recorded, options),
        _ => optimise::profile(recorded, options),
    }
}
