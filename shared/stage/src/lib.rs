//! What the four stage processes share: the run directory, the log, the life line to the
//! supervisor, signs of life, and the surfaces of keyframes read in place.
//!
//! A stage is then a shell of about a page: open, wait, one pure step, write down, hand on.
#![forbid(unsafe_code)]

mod clock;
mod context;
mod error;
mod keyframes;
mod kill_point;
mod lifeline;
mod log;
mod memory;
mod names;
mod pulse;
mod run_file;

pub use clock::monotonic_nanos;
pub use context::{Context, IDLE, Outcome, StageArgs, stage_main};
pub use error::StageError;
pub use keyframes::{MappedKeyframes, journal_slot, store_slot};
pub use kill_point::{KILL_POINTS, KILL_POINTS_VARIABLE, KillPoints};
pub use lifeline::Lifeline;
pub use log::{last_lines, start_log};
pub use memory::{ran_out_of_memory, stage_settings};
pub use names::{ALIGN_JOURNAL, OPTIMISE_JOURNAL, RunFiles};
pub use pulse::Pulse;
pub use run_file::{MapIdentity, RECENT_SURFACES, RunFile};
