//! Events of the stages' lives, for a trace.

use crate::plan::Plan;
use tessera_messages::Stage;
use tessera_stage::{TraceEvent, Tracer, monotonic_nanos};

/// Puts marks into the trace, where the run has one.
#[derive(Debug)]
pub(crate) struct SharedMemoryMarks(Option<Tracer>);

impl SharedMemoryMarks {
    /// The marks of a plan's run; the log says where they cannot be written.
    pub(crate) fn of(plan: &Plan) -> Self {
        let tracer = plan.trace_folder().map(|folder| Tracer::open(&folder, "supervisor"));
        Self(
            tracer.and_then(|opened| {
                opened.map_err(|error| tracing::warn!("no marks in the trace: {error}")).ok()
            }),
        )
    }

    /// Something happened to a stage just now.
    pub(crate) fn note(&mut self, stage: Stage, name: impl FnOnce() -> String) {
        if let Some(tracer) = &mut self.0 {
            let (stage, name) = (stage.name().to_owned(), name());
            tracer.note(&TraceEvent::Mark { stage, name, at: monotonic_nanos() });
            tracer.flush();
        }
    }
}
