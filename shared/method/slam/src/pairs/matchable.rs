//! A keyframe made ready for data association.

use crate::map::context::Context;
use crate::map::state::KeyframeState;
use crate::map::surfaces::KeyframeSurfaces;
use crate::pairs::lift::lift;
use crate::pairs::matching::Seen;
use std::borrow::Cow;
use std::sync::{Arc, OnceLock};
use tessera_features::{Feature, Observation};
use tessera_geometry::{Twist, Vector6};
use tessera_registration::{KdTree, Queries, Sampler, ShutterTable, Target, gather};
use tessera_surface::{Grid, SurfaceView, Vertex};

/// A keyframe as both sides of a pair: its samples as queries, its surface as a target, each with
/// the readout motion at its stamp.
pub(crate) struct Matchable<'a> {
    queries: OnceLock<Queries>,
    /// The vertices of its samples, where these are not taken yet: a target needs none.
    drawn: Arc<[u32]>,
    shutter: ShutterTable,
    surface: KeyframeSurface<'a>,
    tree: Option<KdTree>,
    velocity: Twist,
    /// The run whose camera saw it.
    session: u32,
    features: Cow<'a, [Feature]>,
    observations: OnceLock<Vec<Observation>>,
}

/// The surface of a keyframe, which is read when it is looked at: of many keyframes not all are at hand.
#[derive(Clone, Copy)]
pub(crate) struct KeyframeSurface<'a> {
    pub(crate) surfaces: &'a dyn KeyframeSurfaces,
    pub(crate) keyframe: u32,
    pub(crate) grid: Grid,
}

impl<'a> KeyframeSurface<'a> {
    pub(crate) fn vertices(&self) -> Cow<'a, [Vertex]> {
        self.surfaces.vertices_once(self.keyframe)
    }

    /// As a view, of its [`Self::vertices`].
    pub(crate) fn view<'v>(&self, vertices: &'v [Vertex]) -> SurfaceView<'v> {
        SurfaceView { grid: self.grid, vertices }
    }
}

impl<'a> Matchable<'a> {
    /// A keyframe with its samples drawn.
    pub(crate) fn new(
        context: &Context,
        sampler: &mut Sampler,
        keyframe: &KeyframeState,
        surfaces: &'a dyn KeyframeSurfaces,
    ) -> Self {
        let draw =
            |view: &SurfaceView<'_>| sampler.choose(view, keyframe.frame_index, &context.registration).into();
        let matchable = Self::with_drawn(context, keyframe, surfaces, draw);
        matchable.queries();
        matchable
    }

    /// A keyframe with these of its vertices as samples.
    pub(crate) fn with_drawn(
        context: &Context,
        keyframe: &KeyframeState,
        surfaces: &'a dyn KeyframeSurfaces,
        draw: impl FnOnce(&SurfaceView<'_>) -> Arc<[u32]>,
    ) -> Self {
        let (context, session) = (context.of(keyframe.session), keyframe.session);
        let surface = KeyframeSurface { surfaces, keyframe: keyframe.id, grid: context.grid };
        let vertices = surface.vertices();
        let view = surface.view(&vertices);
        let velocity = Twist::from_vector(&Vector6::from_column_slice(&keyframe.velocity));
        let shutter = context.shutter(&velocity);
        let (drawn, tree, features) = (draw(&view), context.tree(&view, &shutter), Cow::default());
        let (queries, observations) = (OnceLock::new(), OnceLock::new());
        Self { queries, drawn, shutter, surface, tree, velocity, session, features, observations }
    }

    /// Its samples.
    pub(crate) fn queries(&self) -> &Queries {
        self.queries.get_or_init(|| {
            let (mut samples, mut queries) = (Vec::new(), Queries::default());
            gather(&self.surface.view(&self.vertices()), &self.drawn, &mut samples);
            queries.fill(&samples, &self.shutter);
            queries
        })
    }

    /// The keyframe with its features.
    pub(crate) fn with_features(self, context: &Context, features: Cow<'a, [Feature]>) -> Self {
        if context.mapping.features.enabled { Self { features, ..self } } else { self }
    }

    /// Number of its features.
    pub(crate) fn n_features(&self) -> usize {
        self.features.len()
    }

    /// Its features with their observations, which are made when they are first asked for.
    pub(crate) fn seen(&self, context: &Context) -> Seen<'_> {
        let observe = || {
            let vertices = self.vertices();
            let context = context.of(self.session);
            lift(&context, &self.features, &self.surface.view(&vertices), &self.velocity)
        };
        let observations = self.observations.get_or_init(observe);
        Seen { features: &self.features, observations, session: Some(self.session) }
    }

    pub(crate) fn vertices(&self) -> Cow<'a, [Vertex]> {
        self.surface.vertices()
    }

    /// As a target, of its [`Self::vertices`].
    pub(crate) fn target<'v>(&'v self, vertices: &'v [Vertex]) -> Target<'v> {
        let surface = self.surface.view(vertices);
        Target { surface, shutter: &self.shutter, tree: self.tree.as_ref() }
    }
}
