//! Load shedding: the settings of the method at each workload level.

use crate::map::context::Context;
use tessera_surface::WorkloadLevel;

/// One immutable context for each level, from the full one down.
#[derive(Debug)]
pub(crate) struct Workload([Context; WorkloadLevel::ALL.len()]);

impl Workload {
    /// The levels of a context at full workload.
    pub(crate) fn new(full: &Context) -> Self {
        Self(WorkloadLevel::ALL.map(|workload| {
            let mut context = full.clone();
            let registration = &mut context.registration;
            registration.uniform_samples = workload.points(registration.uniform_samples);
            registration.normal_space_samples = workload.points(registration.normal_space_samples);
            let window = &mut context.mapping.window;
            window.match_budget = workload.points(window.match_budget);
            window.size = workload.window(window.size);
            context
        }))
    }

    /// The settings of a frame with that workload.
    pub(crate) fn at(&self, workload: WorkloadLevel) -> &Context {
        &self.0[workload.level()]
    }
}
