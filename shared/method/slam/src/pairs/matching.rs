//! Matches of a frame with a reference, and the relative pose that they agree on.

use crate::map::context::Context;
use crate::pairs::weighted_pair::FeaturePair;
use nalgebra::Vector3;
use std::borrow::Cow;
use tessera_features::{
    Correspondence, Feature, Gate, MatchSettings, MatchWorkspace, Observation, PoseSettings, PoseWorkspace,
    estimate_pose, match_features,
};
use tessera_geometry::Pose;

/// Features that make a pose.
pub(crate) const LEAST_OF_POSE: usize = 12;
/// Depth taken for a feature without one where a match is predicted, metres.
const USUAL_DEPTH_M: f64 = 2.0;

/// One frame's features with their observations.
#[derive(Clone, Copy)]
pub(crate) struct Seen<'a> {
    pub(crate) features: &'a [Feature],
    pub(crate) observations: &'a [Observation],
    /// The run whose camera saw them; `None`: that of the context.
    pub(crate) session: Option<u32>,
}

/// Search region of matches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reach {
    /// About a predicted pose.
    Near,
    /// Without one.
    Anywhere,
    /// About a pose that other features agree on: the pair's is refined from it, and no other is looked for.
    Known,
}

impl Reach {
    const NEAR_PX: f64 = 45.0;
    const KNOWN_PX: f64 = 16.0;

    /// Largest distance from the predicted pixel; none without a prediction.
    fn radius_px(self) -> Option<f64> {
        match self {
            Self::Near => Some(Self::NEAR_PX),
            Self::Anywhere => None,
            Self::Known => Some(Self::KNOWN_PX),
        }
    }
}

/// Buffers of matching and pose.
pub(crate) struct PairFinder {
    matching: MatchWorkspace,
    pose: PoseWorkspace,
    match_settings: MatchSettings,
    pose_settings: PoseSettings,
    gates: Vec<Gate>,
    correspondences: Vec<Correspondence>,
}

impl PairFinder {
    pub(crate) fn new(context: &Context) -> Self {
        let arch = context.registration.isa.arch();
        Self {
            matching: MatchWorkspace::new(arch),
            pose: PoseWorkspace::new(arch),
            match_settings: MatchSettings::default(),
            pose_settings: PoseSettings {
                min_inliers: LEAST_OF_POSE as u32,
                max_iterations: 100,
                refine_iterations: 4,
                ..PoseSettings::default()
            },
            gates: Vec::new(),
            correspondences: Vec::new(),
        }
    }

    /// The pair's matches near where `guess` (`target_from_query`) predicts them, or anywhere without
    /// a radius, and the pose they agree on.
    pub(crate) fn find(
        &mut self,
        context: &Context,
        [query, target]: [Seen<'_>; 2],
        guess: &Pose,
        reach: Reach,
        seed: u64,
    ) -> Option<FeaturePair> {
        if query.features.len().min(target.features.len()) < LEAST_OF_POSE {
            return None;
        }
        self.associate(context, [query, target], guess, reach);
        let correspondences = &self.correspondences;
        let guesses = [*guess];
        let guesses = if reach != Reach::Anywhere { &guesses[..] } else { &[] };
        let most = if reach == Reach::Known { 0 } else { self.pose_settings.max_iterations };
        let settings = PoseSettings { max_iterations: most, ..self.pose_settings.clone() };
        let found = estimate_pose(correspondences, guesses, seed, &settings, &mut self.pose)?;
        let inliers: Vec<Correspondence> =
            found.inliers.iter().map(|i| correspondences[*i as usize]).collect();
        Some(FeaturePair::new(found.target_from_query, inliers))
    }

    /// The pair's matches by their descriptors, near where `guess` predicts them.
    pub(crate) fn matches(
        &mut self,
        context: &Context,
        sides: [Seen<'_>; 2],
        guess: &Pose,
        reach: Reach,
    ) -> Vec<Correspondence> {
        self.associate(context, sides, guess, reach);
        self.correspondences.clone()
    }

    fn associate(&mut self, context: &Context, [query, target]: [Seen<'_>; 2], guess: &Pose, reach: Reach) {
        let gates = reach.radius_px().map(|radius_px| {
            self.gates.clear();
            let context = target.session.map_or(Cow::Borrowed(context), |session| context.of(session));
            let arch = context.registration.isa.arch();
            let (context, observations, gates) = (&*context, query.observations, &mut self.gates);
            arch.dispatch(Predict { context, guess, observations, radius_px, gates });
            self.gates.as_slice()
        });
        let matches =
            match_features(query.features, target.features, gates, &self.match_settings, &mut self.matching);
        self.correspondences.clear();
        self.correspondences.extend(matches.iter().map(|m| Correspondence {
            query: query.observations[m.query as usize],
            target: target.observations[m.target as usize],
        }));
    }
}

/// The gates of all observations, compiled for each instruction set.
struct Predict<'a> {
    context: &'a Context,
    /// `target_from_query`.
    guess: &'a Pose,
    observations: &'a [Observation],
    radius_px: f64,
    gates: &'a mut Vec<Gate>,
}

impl pulp::WithSimd for Predict<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _simd: S) {
        let Self { context, guess, observations, radius_px, gates } = self;
        for observation in observations {
            gates.push(gate(context, guess, observation, radius_px));
        }
    }
}

#[inline(always)]
fn gate(context: &Context, guess: &Pose, o: &Observation, radius_px: f64) -> Gate {
    let usual = || Vector3::new(o.ray[0], o.ray[1], 1.0) * USUAL_DEPTH_M;
    let point = o.point.map_or_else(usual, |p| p.position_m);
    let seen = guess.rotation * point + guess.translation.vector;
    let pixel = context.colour.pixel(&context.camera, &seen).unwrap_or([f64::NAN; 2]);
    Gate { pixel: pixel.map(|p| p as f32), radius_px: radius_px as f32 }
}
