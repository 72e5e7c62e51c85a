//! Feature matching of the tracker: the frame's features, the references', and the pairs between them.

use crate::estimation::colour_model::{ColourModel, LEAST_RESIDUAL_PX};
use crate::estimation::colour_pose::ParameterMatrix;
use crate::estimation::noise_scales::NoiseScales;
use crate::evidence::pose_agreement::CHI_SQUARE_6;
use crate::evidence::same_place;
use crate::map::context::Context;
use crate::map::state::KeyframeState;
use crate::pairs::colour_coupling::coupling;
use crate::pairs::colour_evidence::own_nats;
use crate::pairs::lift::lift;
use crate::pairs::matching::{PairFinder, Reach, Seen};
use crate::pairs::residuals;
use crate::pairs::weighted_pair::{FeaturePair, WeightedPair};
use crate::settings::WindowSettings;
use crate::tracking::input::{FrameSurface, TrackingInput};
use crate::tracking::observed::Observed;
use crate::tracking::prediction::Reference;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;
use tessera_features::{Feature, Observation, PlaceIndex};
use tessera_geometry::{Matrix6, Pose, Twist, compose_normalised};
use tessera_graph::{BlockSums, PairBlock};
use tessera_numerics::Step;
use tessera_surface::SurfaceView;

/// Least number of features of a view for which missing matches with another view are evidence.
pub(crate) const ENOUGH_FEATURES: usize = 100;

/// Names a surface: as [`Reference::key`].
pub(crate) type SurfaceKey = (bool, u64);

/// Keyframes whose ids differ by no more show the same place.
pub(crate) const NEAR_IN_TIME: u32 = 4;

/// Pairs with references, those without a result too.
type Pairs = BTreeMap<SurfaceKey, Option<Arc<FeaturePair>>>;

/// Observations of one reference, with what they were made from.
struct KnownObservations {
    /// The frame that asked for them last.
    asked_by: u64,
    model: ColourModel,
    velocity: Twist,
    observations: Arc<[Observation]>,
}

/// The tracker's features: buffers and what is known of this frame. Nothing of it is state.
pub(crate) struct Sight {
    pub(crate) finder: PairFinder,
    known: BTreeMap<SurfaceKey, KnownObservations>,
    index: u64,
    /// Motion that the observations were made with.
    velocity: Twist,
    features: Vec<Feature>,
    n_features: usize,
    /// The image is that of the frame before.
    pub(crate) is_repeated: bool,
    observations: Arc<[Observation]>,
    pairs: Pairs,
    /// Pairs of an image that is of another time.
    refused: Pairs,
    /// The active keyframes of all submaps, as of the last recognition; sets of keyframes that differ much have an
    /// index each.
    places: BTreeMap<u32, PlaceIndex>,
    /// The index that is used: the caller's name of a set.
    pub(crate) places_used: u32,
    /// An index has those keyframes alone among which a frame is looked for: what it sees depends on no other.
    pub(crate) holds_admitted_only: bool,
}

impl Sight {
    pub(crate) fn new(context: &Context) -> Self {
        Self {
            finder: PairFinder::new(context),
            known: BTreeMap::new(),
            index: 0,
            velocity: Twist::default(),
            features: Vec::new(),
            n_features: 0,
            is_repeated: false,
            observations: Arc::new([]),
            pairs: BTreeMap::new(),
            refused: BTreeMap::new(),
            places: BTreeMap::new(),
            places_used: 0,
            holds_admitted_only: false,
        }
    }

    /// Takes a frame's features in. Those of a repeated image are left out (in the dark some cameras deliver each
    /// image twice): its matches would hold the camera still. `before` is the frame that the state names as its
    /// last, so that the answer does not depend on which frames are still at hand.
    pub(crate) fn begin(
        &mut self,
        context: &Context,
        frame: &FrameSurface<'_>,
        before: Option<&FrameSurface<'_>>,
        velocity: &Twist,
    ) {
        self.is_repeated =
            !frame.features.is_empty() && before.is_some_and(|before| before.features == frame.features);
        // What the frame before asked for may be asked for again.
        self.known.retain(|_, known| known.asked_by == self.index);
        self.index = frame.index;
        self.velocity = *velocity;
        self.pairs.clear();
        self.refused.clear();
        self.features.clear();
        if context.mapping.features.enabled && !self.is_repeated {
            self.features.extend_from_slice(frame.features);
        }
        self.n_features = self.features.len();
        self.observations = lift(context, &self.features, &frame.surface, velocity).into();
    }

    /// Leaves out features of this frame by their points, metres in its camera.
    pub(crate) fn leave_out(&mut self, is_left_out: impl Fn(&[f32; 3]) -> bool) {
        let is_kept = |o: &Observation| {
            o.point.is_none_or(|point| !is_left_out(&std::array::from_fn(|k| point.position_m[k] as f32)))
        };
        let kept: Vec<bool> = self.observations.iter().map(is_kept).collect();
        let mut of_features = kept.iter();
        self.features.retain(|_| of_features.next() != Some(&false));
        let all = self.observations.iter().zip(&kept);
        self.observations = all.filter(|(_, is_kept)| **is_kept).map(|(o, _)| *o).collect();
    }

    /// Observes the features again with a better known motion, where that moves them.
    pub(crate) fn observe_again(&mut self, context: &Context, surface: &SurfaceView<'_>, velocity: &Twist) {
        let change = Twist { rho: velocity.rho - self.velocity.rho, phi: velocity.phi - self.velocity.phi };
        let seconds = context.colour.lag_s.abs() + 0.25 * context.camera.readout_s.abs();
        if (change.phi.norm() + 0.5 * change.rho.norm()) * seconds * context.camera.focal_px()
            < LEAST_RESIDUAL_PX
        {
            return;
        }
        self.velocity = *velocity;
        self.pairs.clear();
        self.observations = lift(context, &self.features, surface, velocity).into();
    }

    /// Refuses the pairs found so far: they are no measurement, and colour is judged by them.
    pub(crate) fn refuse_pairs(&mut self) {
        self.refused = std::mem::take(&mut self.pairs);
    }

    /// Features of the frame, those that were left out among them.
    pub(crate) fn n_features(&self) -> usize {
        self.n_features
    }

    /// The pair with a reference: found once for each frame, within reach of
    /// `world_from_camera`.
    pub(crate) fn pair(
        &mut self,
        context: &Context,
        reference: &Reference<'_>,
        world_from_camera: &Pose,
        reach: Reach,
    ) -> Option<Arc<FeaturePair>> {
        if let Some(Some(known)) = self.pairs.get(&reference.key) {
            return Some(Arc::clone(known));
        }
        context.steps.enter(Step::Match);
        let guess = reference.world_from_camera.inverse() * world_from_camera;
        let found = self.find(context, reference, &guess, reach);
        let found = found.map(Arc::new);
        self.pairs.insert(reference.key, found.clone());
        found
    }

    /// Keyframes that show most of these features, the best first: at most `n`, of neighbours in time
    /// the best one, and with at least `min_words` of them.
    pub(crate) fn recognise(
        &mut self,
        input: &TrackingInput<'_>,
        features: &[Feature],
        [n, min_words]: [usize; 2],
        is_admitted: impl Fn(&KeyframeState) -> bool,
    ) -> Vec<u32> {
        let map = input.map.state();
        let is_held = |k: &&KeyframeState| !self.holds_admitted_only || is_admitted(k);
        let held = map.active().filter(is_held).map(|keyframe| keyframe.id);
        let arch = input.context.registration.isa.arch();
        let places = self.places.entry(self.places_used).or_insert_with(|| PlaceIndex::new(arch));
        places.hold_only(held, |id| input.surfaces.keyframes.features_once(id));
        let mut admitted = vec![false; map.keyframes.len()];
        map.active().filter(|k| is_admitted(k)).for_each(|k| admitted[k.id as usize] = true);
        if !admitted.contains(&true) {
            return Vec::new();
        }
        let is_admitted = |id: u32| admitted.get(id as usize) == Some(&true);
        // Of each place all may be found.
        let n_found = n * (2 * NEAR_IN_TIME as usize + 1);
        let found = places.find(features, n_found, min_words as u32, is_admitted);
        let mut chosen: Vec<u32> = Vec::new();
        for place in found.iter().map(|found| found.place) {
            if chosen.len() < n && chosen.iter().all(|other| other.abs_diff(place) > NEAR_IN_TIME) {
                chosen.push(place);
            }
        }
        chosen
    }

    /// As [`Self::recognise`], for the frame's own features.
    pub(crate) fn recognise_frame(
        &mut self,
        input: &TrackingInput<'_>,
        n: [usize; 2],
        is_admitted: impl Fn(&KeyframeState) -> bool,
    ) -> Vec<u32> {
        let features = std::mem::take(&mut self.features);
        let found = self.recognise(input, &features, n, is_admitted);
        self.features = features;
        found
    }

    fn observations_of(&mut self, context: &Context, reference: &Reference<'_>) -> Arc<[Observation]> {
        if let Some(known) = self.known.get_mut(&reference.key)
            && known.model == context.colour
            && known.velocity == reference.velocity
            && known.observations.len() == reference.features.len()
        {
            known.asked_by = self.index;
            return Arc::clone(&known.observations);
        }
        let (model, velocity) = (context.colour, reference.velocity);
        let observations: Arc<[Observation]> =
            lift(&seen_by(context, reference), reference.features, &reference.surface, &velocity).into();
        let (asked_by, kept) = (self.index, Arc::clone(&observations));
        self.known.insert(reference.key, KnownObservations { asked_by, model, velocity, observations: kept });
        observations
    }

    /// Gives references the features that they share with the frame; `weight` of metric information in
    /// the units of the blocks.
    pub(crate) fn pair_all(
        &mut self,
        context: &Context,
        references: &mut [Reference<'_>],
        world_from_camera: &Pose,
        weight: f64,
    ) {
        if self.features.is_empty() {
            return;
        }
        for reference in references.iter_mut() {
            let pair = self.pair(context, reference, world_from_camera, Reach::Known);
            let at = reference.world_from_camera.inverse() * world_from_camera;
            reference.pair = pair.map(|pair| WeightedPair::new(pair, weight, &at));
        }
    }

    /// Features that agree with an alignment, of the reference that has most.
    pub(crate) fn n_agreeing(&self, references: &[Reference<'_>], world_from_camera: &Pose) -> u32 {
        let mut most = 0;
        for reference in references {
            let Some(pair) = &reference.pair else { continue };
            let inliers = &pair.found.inliers;
            // With fewer it cannot have most.
            if inliers.len() > most {
                let at = reference.world_from_camera.inverse() * world_from_camera;
                most = most.max(residuals::n_within(inliers, &at, CHI_SQUARE_6));
            }
        }
        most as u32
    }

    /// Features that agree with an alignment to a reference, matched anew wherever they are: a pair that is known may
    /// have been looked for about another pose.
    pub(crate) fn n_agreeing_anywhere(
        &mut self,
        context: &Context,
        reference: &Reference<'_>,
        world_from_camera: &Pose,
    ) -> usize {
        let at = reference.world_from_camera.inverse() * world_from_camera;
        let found = self.find(context, reference, &at, Reach::Anywhere);
        found.map_or(0, |pair| same_place::n_agreeing(&pair.inliers, &at))
    }

    /// Whether features agree with `target_from_query` where they are looked for near it alone.
    pub(crate) fn agree_near(
        &mut self,
        context: &Context,
        reference: &Reference<'_>,
        target_from_query: &Pose,
    ) -> bool {
        let found = self.find(context, reference, target_from_query, Reach::Near);
        found.is_some_and(|pair| same_place::makes_pose(&pair.inliers, target_from_query))
    }

    fn find(
        &mut self,
        context: &Context,
        reference: &Reference<'_>,
        target_from_query: &Pose,
        reach: Reach,
    ) -> Option<FeaturePair> {
        let observations = self.observations_of(context, reference);
        let query = Seen { features: &self.features, observations: &self.observations, session: None };
        let session = reference.session;
        let target = Seen { features: reference.features, observations: &observations, session };
        let seed = self.index.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ reference.key.1;
        self.finder.find(context, [query, target], target_from_query, reach, seed)
    }

    /// Features of the frame that would agree with a reference at a pose, were it the same place: of those that it
    /// would have to see, the share that agrees with `before`, the preceding view.
    pub(crate) fn n_expected(
        &mut self,
        context: &Context,
        before: Option<&Reference<'_>>,
        (target, target_from_query): (&Reference<'_>, &Pose),
    ) -> f64 {
        let (seen_by, surface) = (seen_by(context, target), &target.surface);
        let n = same_place::n_comparable(&seen_by, &self.observations, surface, target_from_query);
        n as f64 * before.map_or(0.0, |before| self.agreeing_share(context, before))
    }

    /// Share of the comparable features that agree with the preceding view, on whatever pose they agree.
    fn agreeing_share(&mut self, context: &Context, before: &Reference<'_>) -> f64 {
        let pair = self.pair(context, before, &before.world_from_camera, Reach::Anywhere);
        pair.map_or(0.0, |pair| {
            let there = (&before.surface, &pair.target_from_query);
            same_place::agreeing_share(&seen_by(context, before), &self.observations, &pair.inliers, there)
        })
    }

    /// Features of a pair already found that agree with a relative pose, `target_from_query`.
    pub(crate) fn n_agreeing_with(&self, key: SurfaceKey, at: &Pose) -> usize {
        let Some(Some(pair)) = self.pairs.get(&key) else { return 0 };
        residuals::n_within(&pair.inliers, at, CHI_SQUARE_6)
    }

    /// Judges the features that the frame shares with a keyframe by the pose that surfaces give.
    pub(crate) fn judge(&self, context: &Context, judged: &Judged<'_>, sums: &mut Observed) {
        let found =
            [&self.refused, &self.pairs].into_iter().find_map(|pairs| pairs.get(&judged.key)?.as_ref());
        let Some(pair) = found else { return };
        let velocities = [&self.velocity, &judged.velocity];
        let at = by_surfaces(judged);
        let of = |origin: &Pose, sums: &BlockSums, scale: f64| {
            let (h, g, _) = PairBlock::new(origin, sums).linearise(&judged.target_from_query);
            (h / scale, g / scale)
        };
        let NoiseScales { surfaces, features } = context.scales;
        let of_surfaces = of(&judged.origin, judged.sums, judged.factor * surfaces);
        let of_features = of(&pair.target_from_query, &pair.sums, features);
        let coupling = coupling(pair, velocities, &context.colour) / features;
        let nats = own_nats(&of_surfaces, &of_features, &coupling, &judged.parameters);
        sums.add(&context.camera, &pair.inliers, &at, nats);
    }
}

/// The context of the camera that saw a reference.
fn seen_by<'a>(context: &'a Context, reference: &Reference<'_>) -> Cow<'a, Context> {
    reference.session.map_or(Cow::Borrowed(context), |session| context.of(session))
}

/// A pair whose surfaces judge colour.
pub(crate) struct Judged<'a> {
    pub(crate) key: SurfaceKey,
    /// As aligned, and where the sums are about.
    pub(crate) target_from_query: Pose,
    pub(crate) origin: Pose,
    /// Of the surfaces alone.
    pub(crate) sums: &'a BlockSums,
    /// Makes them metric.
    pub(crate) factor: f64,
    /// Of the target.
    pub(crate) velocity: Twist,
    /// Covariance of lag and focal ratio before anything is measured.
    pub(crate) parameters: ParameterMatrix,
}

/// The relative pose by the surfaces alone; as aligned where they leave it free.
fn by_surfaces(judged: &Judged<'_>) -> Pose {
    let block = PairBlock::new(&judged.origin, judged.sums);
    let prior = Matrix6::identity() * (judged.factor / WindowSettings::FREE_SIGMA.powi(2));
    let (h, g, _) = block.linearise(&judged.target_from_query);
    let step = (h + prior).cholesky().map(|factor| -factor.solve(&g));
    step.map_or(judged.target_from_query, |step| {
        compose_normalised(&judged.target_from_query, &Twist::from_vector(&step))
    })
}
