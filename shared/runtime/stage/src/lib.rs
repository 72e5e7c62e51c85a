//! Common parts of the four stage processes: the run directory, the log, the life line to the
//! supervisor, signs of life, and the surfaces of keyframes read in place.
//!
//! A stage is then a shell of about a page: open, wait, one pure step, write down, hand on.
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

mod base;
mod broken;
mod checkpoint;
mod clock;
mod context;
mod error;
mod keyframes;
mod kill_point;
mod lifeline;
mod log;
mod marks;
mod memory;
mod names;
mod notify;
mod priority;
mod probe;
mod pulse;
mod record_versions;
mod run_file;
mod standstill;
mod stopwatch;
mod tracer;

pub use base::{BaseAnswer, BaseContact, BaseContactWriter, MAX_ANSWER_BYTES};
pub use broken::BrokenFrames;
pub use checkpoint::Checkpoint;
pub use clock::{cpu_nanos, monotonic_nanos};
pub use context::{IDLE, Outcome, POISON_VARIABLE, StageArgs, StageContext, stage_main};
pub use error::StageError;
pub use keyframes::{StoredKeyframes, journal_slot, slots, store_slot};
pub use kill_point::{
    Delivery, KILL_POINTS, KILL_POINTS_VARIABLE, KillPoints, MESSAGE_POINTS, STRUCK, fault_names,
};
pub use lifeline::Lifeline;
pub use log::{last_lines, log_line, start_log};
pub use marks::{Marks, StateAt};
pub use memory::ran_out_of_memory;
pub use names::RunFiles;
pub use notify::{NOTIFY_VARIABLES, SystemdNotifier};
pub use probe::{PROBE_VARIABLE, PROBED, Probe};
pub use pulse::{FIRST_OUTPUT, Pulse, READY};
pub use record_versions::{ALIGN_JOURNAL, OPTIMISE_JOURNAL};
pub use run_file::{MapIdentity, RECENT_SURFACES, RunFile, identity_of};
pub use standstill::{AwakeDeadline, Standstill};
pub use stopwatch::{Distributions, StepSpan, Stopwatch};
pub use tracer::{TRACE_VARIABLE, TraceEvent, Tracer, read_trace};
