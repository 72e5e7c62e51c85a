//! A keyframe made ready for data association.

use crate::features::lift::lift;
use crate::features::matching::Seen;
use crate::map::context::Context;
use crate::map::state::KeyframeState;
use crate::map::surfaces::KeyframeSurfaces;
use std::sync::OnceLock;
use tessera_features::{Feature, Observation};
use tessera_geometry::{Twist, Vector6};
use tessera_registration::{KdTree, Queries, Sample, Sampler, ShutterTable, Target};
use tessera_surface::SurfaceView;

/// A keyframe as both sides of a pair: its samples as queries, its surface as a target, each with
/// the readout motion at its stamp.
pub(crate) struct Matchable<'a> {
    pub(crate) queries: Queries,
    shutter: ShutterTable,
    surface: SurfaceView<'a>,
    tree: Option<KdTree>,
    velocity: Twist,
    features: &'a [Feature],
    observations: OnceLock<Vec<Observation>>,
}

impl<'a> Matchable<'a> {
    /// A keyframe with its samples drawn.
    pub(crate) fn new(
        context: &Context,
        sampler: &mut Sampler,
        keyframe: &KeyframeState,
        surfaces: &'a dyn KeyframeSurfaces,
    ) -> Self {
        let surface = SurfaceView { grid: context.grid, vertices: surfaces.vertices(keyframe.id) };
        let mut samples = Vec::new();
        sampler.draw(&surface, keyframe.frame_index, &context.registration, &mut samples);
        Self::with_samples(context, keyframe, surface, &samples)
    }

    /// A keyframe with samples that are known.
    pub(crate) fn with_samples(
        context: &Context,
        keyframe: &KeyframeState,
        surface: SurfaceView<'a>,
        samples: &[Sample],
    ) -> Self {
        let velocity = Twist::from_vector(&Vector6::from_column_slice(&keyframe.velocity));
        let shutter = context.shutter(&velocity);
        let mut queries = Queries::default();
        queries.fill(samples, &shutter);
        let tree = context.tree(&surface, &shutter);
        Self { queries, shutter, surface, tree, velocity, features: &[], observations: OnceLock::new() }
    }

    /// The keyframe with its features.
    pub(crate) fn with_features(self, context: &Context, features: &'a [Feature]) -> Self {
        if context.mapping.features.enabled { Self { features, ..self } } else { self }
    }

    /// Its features with their observations, which are made when they are first asked for.
    pub(crate) fn seen(&self, context: &Context) -> Seen<'_> {
        let observe = || lift(context, self.features, &self.surface, &self.velocity);
        Seen { features: self.features, observations: self.observations.get_or_init(observe) }
    }

    pub(crate) fn target(&self) -> Target<'_> {
        Target { surface: self.surface, shutter: &self.shutter, tree: self.tree.as_ref() }
    }
}
