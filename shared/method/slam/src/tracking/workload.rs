//! Load shedding: the settings of the method at each workload level.

use crate::map::context::Context;
use tessera_surface::Effort;

/// One immutable context for each level, from the full one down.
#[derive(Debug)]
pub(crate) struct Workload([Context; Effort::ALL.len()]);

impl Workload {
    /// The levels of a context at full effort.
    pub(crate) fn new(full: &Context) -> Self {
        Self(Effort::ALL.map(|effort| {
            let mut context = full.clone();
            let registration = &mut context.registration;
            registration.uniform_samples = effort.points(registration.uniform_samples);
            registration.normal_space_samples = effort.points(registration.normal_space_samples);
            let window = &mut context.mapping.window;
            window.match_budget = effort.points(window.match_budget);
            window.size = effort.window(window.size);
            context
        }))
    }

    /// The settings of a frame with that effort.
    pub(crate) fn at(&self, effort: Effort) -> &Context {
        &self.0[effort.rung()]
    }
}
