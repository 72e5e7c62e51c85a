//! The clock around one step of a stage, and the comparison with what was recorded.

use super::report::ProfileReport;
use std::sync::Arc;
use tessera_messages::{Phase, Stage};
use tessera_numerics::Steps;
use tessera_outputs::ToolError;
use tessera_stage::{Distributions, Stopwatch, cpu_nanos, monotonic_nanos};

/// How a stage is run.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Passes over the whole recording, each from nothing.
    pub repeat: u64,
    /// Whether steps are measured too.
    pub steps: bool,
}

/// Measures one piece of work after the other.
pub(super) struct Meter {
    stage: Stage,
    stopwatch: Arc<Stopwatch>,
    has_steps: bool,
    distributions: Distributions,
    cpu_nanos: u64,
    output: u32,
    n_done: u64,
}

impl Meter {
    pub(super) fn new(stage: Stage, options: &Options) -> Self {
        Self {
            stage,
            stopwatch: Stopwatch::new(false),
            has_steps: options.steps,
            distributions: Distributions::default(),
            cpu_nanos: 0,
            output: 0,
            n_done: 0,
        }
    }

    /// What the stage announces its steps to.
    pub(super) fn steps(&self) -> Steps {
        if self.has_steps { self.stopwatch.steps() } else { Steps::default() }
    }

    /// Does one piece of work and measures it.
    pub(super) fn time<T>(&mut self, work: impl FnOnce() -> T) -> T {
        let (cpu, began) = (cpu_nanos(), monotonic_nanos());
        let done = work();
        // What follows belongs to no step, not to the last one either.
        self.steps().leave();
        self.distributions.phase(Phase::Computing, monotonic_nanos().saturating_sub(began));
        self.cpu_nanos += cpu_nanos().saturating_sub(cpu);
        self.distributions.frame(&self.stopwatch);
        done
    }

    /// Compares the checksum of a result with the recorded one.
    ///
    /// # Errors
    /// Names the piece of work that came out differently.
    pub(super) fn check(&mut self, found: u32, expected: u32, what: &str) -> Result<(), ToolError> {
        if found != expected {
            return Err(ToolError::Stage(format!(
                "{what} came out as {found:08x}, recorded as {expected:08x}: other bits than in the pipeline"
            )));
        }
        self.output = self.output.rotate_left(1) ^ found;
        self.n_done += 1;
        Ok(())
    }

    pub(super) fn report(self, options: &Options) -> ProfileReport {
        let n_done = self.n_done / options.repeat.max(1);
        ProfileReport::new(
            self.stage,
            n_done,
            options.repeat,
            self.cpu_nanos,
            self.output,
            &self.distributions.rows(),
        )
    }
}
