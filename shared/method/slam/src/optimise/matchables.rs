//! The keyframes of an optimisation, each made ready for data association when a pair asks for it: most pairs are known
//! from an earlier one.

use crate::map::context::Context;
use crate::map::state::KeyframeState;
use crate::map::surfaces::KeyframeSurfaces;
use crate::optimise::sample_cache::Drawn;
use crate::pairs::matchable::Matchable;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use tessera_registration::Sampler;
use tessera_surface::SurfaceView;

/// Keyframes by their places among the active ones.
pub(crate) struct Matchables<'a> {
    context: &'a Context,
    keyframes: &'a [KeyframeState],
    surfaces: &'a dyn KeyframeSurfaces,
    drawn: &'a Drawn,
    ready: Vec<OnceLock<Matchable<'a>>>,
    /// Their buffers are worth keeping.
    samplers: Mutex<Vec<Sampler>>,
}

impl<'a> Matchables<'a> {
    pub(crate) fn new(
        context: &'a Context,
        keyframes: &'a [KeyframeState],
        surfaces: &'a dyn KeyframeSurfaces,
        drawn: &'a Drawn,
    ) -> Self {
        let ready = keyframes.iter().map(|_| OnceLock::new()).collect();
        Self { context, keyframes, surfaces, drawn, ready, samplers: Mutex::default() }
    }

    /// The keyframe at a place.
    pub(crate) fn get(&self, place: usize) -> &Matchable<'a> {
        self.ready[place].get_or_init(|| self.make(&self.keyframes[place]))
    }

    /// Its samples are drawn, or known from an earlier optimisation.
    fn make(&self, k: &KeyframeState) -> Matchable<'a> {
        let draw = |view: &SurfaceView<'_>| {
            self.drawn.of((k.id, k.frame_index, view.vertices.len()), || {
                let mut sampler = self.samplers().pop().unwrap_or_default();
                let drawn = sampler.choose(view, k.frame_index, &self.context.registration).into();
                self.samplers().push(sampler);
                drawn
            })
        };
        Matchable::with_drawn(self.context, k, self.surfaces, draw)
            .with_features(self.context, self.surfaces.features_once(k.id))
    }

    fn samplers(&self) -> MutexGuard<'_, Vec<Sampler>> {
        self.samplers.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
