//! The align stage: surfaces come in, poses go out; it owns the map's keyframes.
//!
//! The order for each frame: compute, keyframe surface into the store, record into the journal,
//! publish the pose, acknowledge. Where the map takes its time behind a pose, the pose is published
//! before that. An acknowledged frame is durable; a frame that is not comes again, is computed again
//! to the same bits, and is journaled exactly once.
#![forbid(unsafe_code)]

mod correction;
mod durable_state;
mod flow;
mod inbox;
mod journal_fold;
mod live;
mod load_shedding;
mod lossless;
mod ports;
mod posed;
mod publish;
mod step;

use durable_state::JournaledAligner;
use ports::Ports;
use std::process::ExitCode;
use tessera_messages::Stage;
use tessera_stage::{Checkpoint, Outcome, StageArgs, StageContext, StageError, stage_main};

/// Runs the stage as a process.
pub fn main(args: &StageArgs) -> ExitCode {
    stage_main(Stage::Align, || run(args))
}

/// Why the loop over one durable state ended.
enum Pause {
    /// The stage is done.
    Over(Outcome),
    /// All state is to be thrown away and read back (`run.forget_every`).
    Forget,
}

/// Runs the stage until the run is finished or it is told to stop.
///
/// # Errors
/// Where the run directory, the settings or the shared memory cannot be used.
pub fn run(args: &StageArgs) -> Result<Outcome, StageError> {
    let context = StageContext::open(Stage::Align, args)?;
    // The journal first: it is what says where to go on.
    let mut state = JournaledAligner::open(&context)?;
    let link = context.link(Stage::Align)?;
    let mut ports = Ports::open(&link, &context)?;
    context.kill_points.pass("opened", 0);
    loop {
        ports.pulse.ready(Some(state.fold.tracker.next_index()));
        // What was journaled may not have been published: the same bytes go out again.
        ports.publish_again(&state)?;
        let pause = if context.settings.run.live {
            live::run(&context, &mut state, &mut ports)?
        } else {
            lossless::run(&context, &mut state, &mut ports)?
        };
        match pause {
            Pause::Over(outcome) => {
                if outcome == Outcome::Finished {
                    Checkpoint::remove(&context.files.align_checkpoint());
                }
                ports.pulse.finish();
                return Ok(outcome);
            }
            Pause::Forget => {
                // The lock on the journal goes with the old state.
                drop(state);
                ports.release();
                state = JournaledAligner::open(&context)?;
            }
        }
    }
}
