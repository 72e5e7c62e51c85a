//! What an effort leaves of the settings that tracking goes by.

use crate::context::Context;
use tessera_surface::Effort;

/// The numbers that an effort lowers, as the settings have them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FullEffort {
    effort: Effort,
    uniform_samples: u32,
    normal_space_samples: u32,
    match_budget: u32,
    window_size: u32,
}

impl FullEffort {
    /// Those of a context at full effort.
    pub(crate) fn of(context: &Context) -> Self {
        Self {
            effort: Effort::Full,
            uniform_samples: context.registration.uniform_samples,
            normal_space_samples: context.registration.normal_space_samples,
            match_budget: context.mapping.window.match_budget,
            window_size: context.mapping.window.size,
        }
    }

    /// Sets a context to another effort than it has.
    pub(crate) fn set(&mut self, context: &mut Context, effort: Effort) {
        if self.effort == effort {
            return;
        }
        self.effort = effort;
        context.registration.uniform_samples = effort.points(self.uniform_samples);
        context.registration.normal_space_samples = effort.points(self.normal_space_samples);
        context.mapping.window.match_budget = effort.points(self.match_budget);
        context.mapping.window.size = effort.window(self.window_size);
    }
}
