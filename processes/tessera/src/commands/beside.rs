//! Optional work beside a run: a trace, and metrics for Prometheus.

use crate::arguments::RunArguments;
use crate::commands::metrics::{MetricsServer, listen};
use crate::exit::{CommandError, Exit};
use crate::terminal::{say, say_error};
use tessera_lab::trace::TraceOutput;
use tessera_supervisor::Plan;

/// Launches a plan with all that goes on beside it. What `launch` is given it calls once, when
/// others can see the run.
pub(super) fn with_company(
    plan: &Plan,
    arguments: &RunArguments,
    launch: impl FnOnce(&mut dyn FnMut()) -> Result<Exit, CommandError>,
) -> Result<Exit, CommandError> {
    // Before anything is made: a wrong path or address is told at once.
    let listener = arguments.metrics.map(listen).transpose()?;
    let trace = arguments.trace.as_deref().map(TraceOutput::create).transpose()?;
    let mut server = None;
    let mut when_seen = || {
        let Some((listener, bound)) = &listener else { return };
        match MetricsServer::start(&plan.executable, &plan.run_dir, listener) {
            Ok(started) => server = Some(started),
            // Best effort; failure is ignored.
            Err(error) => return say_error(&format!("no metrics: {error}")),
        }
        if !arguments.speech.quiet && !arguments.speech.json {
            say(&format!("metrics on http://{bound}/metrics, for this machine alone"));
        }
    };
    let launched = launch(&mut when_seen);
    drop(server);
    // A name that was taken: nothing has run.
    if matches!(launched, Err(CommandError::Supervisor(_))) {
        return launched;
    }
    let written = match (trace, plan.trace_folder()) {
        (Some(trace), Some(folder)) => trace.write(&folder),
        _ => Ok(()),
    };
    let exit = launched?;
    written?;
    Ok(exit)
}
