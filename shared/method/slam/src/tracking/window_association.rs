//! Data association of a frame with its window, and what holds its degenerate directions.

use crate::estimation::readout::ReadoutRecord;
use crate::map::context::Context;
use crate::settings::WindowSettings;
use crate::tracking::degeneracy::{self, DegenerateDirection};
use crate::tracking::prediction::{Prediction, Reference};
use tessera_geometry::{Pose, Twist, log};
use tessera_graph::{BlockSums, DataAssociation, Graph, HalfSums, OuterIteration, Pair, PairBlock, Prior};
use tessera_numerics::Step;
use tessera_registration::{MatchLimits, Matcher, PairReport, Queries, Selection, ShutterTable, Target};

/// The pairs of one frame, the last vertex, with each of its references.
pub(crate) struct WindowAssociation<'a, 'b> {
    pub(crate) context: &'a Context,
    pub(crate) prediction: &'a Prediction,
    pub(crate) references: &'a [Reference<'b>],
    /// The references as they are searched.
    pub(crate) targets: Vec<Target<'a>>,
    /// Makes an inverse information matrix metric by the estimated scale.
    pub(crate) factor: f64,
    /// The same by the scale before anything is measured: degeneracy is a matter of geometry.
    pub(crate) nominal_factor: f64,
    pub(crate) matcher: &'a mut Matcher,
    pub(crate) queries: &'a mut Queries,
    pub(crate) shutter: &'a mut ShutterTable,
    /// The frame's motion at its present pose; the prediction's where none is known before it.
    pub(crate) velocity: Twist,
    /// One per reference: where its matches were found, and their sums.
    pub(crate) blocks: Vec<(Pose, BlockSums)>,
    pub(crate) reports: Vec<PairReport>,
    /// One per reference: the sums of its surfaces alone.
    pub(crate) surfaces: Vec<HalfSums>,
    /// Degenerate directions of the tightest matches.
    pub(crate) degenerate: Vec<DegenerateDirection>,
}

impl WindowAssociation<'_, '_> {
    /// Takes the velocity that leads from the frame before to this pose.
    pub(crate) fn follow(&mut self, world_from_camera: &Pose) {
        if let Some((previous, seconds)) = self.prediction.previous {
            self.velocity = log(&(previous.inverse() * world_from_camera)).scaled(1.0 / seconds);
        }
    }

    /// What the matches of the last reference tell of the readout of this camera.
    pub(crate) fn readout(&self) -> Option<ReadoutRecord> {
        let (target, surfaces, (origin, _)) =
            (self.targets.last()?, self.surfaces.last()?, self.blocks.last()?);
        // The first frame of a track has no velocity yet: it would say that there is no readout.
        let is_first = self.references.last()?.velocity == Twist::default();
        if is_first || !self.context.cameras.is_empty() {
            return None;
        }
        let sums = self.matcher.readout_sums(self.queries, target, origin);
        let (normal, gradient, _) = PairBlock::new(origin, &surfaces.all()).linearise(origin);
        ReadoutRecord::new(&sums, (&normal, &gradient), self.factor, self.context.camera.readout_s)
    }
}

impl DataAssociation for WindowAssociation<'_, '_> {
    fn associate(
        &mut self,
        poses: &[Pose],
        iteration: OuterIteration,
        _progress: &mut dyn FnMut(),
    ) -> Vec<Pair> {
        let steps = &self.context.steps;
        steps.enter(Step::Prepare);
        let frame = self.references.len();
        let world_from_camera = poses[frame];
        if iteration.index > 0 {
            self.follow(&world_from_camera);
        }
        self.context.fill_shutter(&self.velocity, self.shutter);
        self.queries.set_shutter(self.shutter);
        self.blocks.clear();
        self.reports.clear();
        self.surfaces.clear();
        let limits = MatchLimits::new(self.prediction.first_distance_m, iteration.tightness);
        let window = &self.context.mapping.window;
        // While the pose is still far off, fewer matches lead it as well.
        let share = if iteration.tightness < 1.0 { WindowSettings::EARLY_SHARE } else { 1.0 };
        let count = (f64::from(window.match_budget) * share) as usize / frame.max(1);
        for (place, (reference, target)) in self.references.iter().zip(&self.targets).enumerate() {
            let selection = Selection { count, shift: place };
            let target_from_query = reference.world_from_camera.inverse() * world_from_camera;
            let (surfaces, report) =
                self.matcher.match_pair(self.queries, selection, target, &target_from_query, &limits);
            self.surfaces.push(surfaces);
            let mut sums = surfaces.all();
            if let Some(pair) = &reference.pair {
                pair.add_to(&mut sums, &target_from_query);
            }
            self.blocks.push((target_from_query, sums));
            self.reports.push(report);
        }
        steps.enter(Step::Solve);
        let pair = |(place, (origin, sums)): (usize, &(Pose, BlockSums))| {
            Pair::new(frame, place, PairBlock::new(origin, sums))
        };
        self.blocks.iter().enumerate().map(pair).collect()
    }

    /// Holds degenerate directions at the prediction.
    fn hold(&mut self, solved: &Graph) -> Vec<Prior> {
        let vertex = self.references.len();
        let centroid = degeneracy::centroid(self.blocks.iter().map(|(_, sums)| sums));
        let metric = solved.information(vertex) / self.nominal_factor;
        self.degenerate = degeneracy::degenerate_directions(&metric, &centroid);
        if self.degenerate.is_empty() {
            return Vec::new();
        }
        let seconds = self.prediction.previous.map_or(0.0, |(_, seconds)| seconds);
        let information = degeneracy::hold(&self.degenerate, seconds) * self.factor;
        let motion = self.prediction.motion.as_ref().map(|motion| motion.world_from_camera);
        let predicted = motion.unwrap_or(self.prediction.world_from_camera);
        vec![Prior { vertex, predicted, information }]
    }
}
