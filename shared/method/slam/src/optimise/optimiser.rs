//! The optimiser's pure step: all keyframes in, a correction out.

use crate::map::context::Context;
use crate::map::input_hash::input_hash;
use crate::map::placement::corrected;
use crate::map::records::{
    AlignRecord, Correction, KeyframePose, LoopRecord, MatchPose, OptimiseRecord, PairChanges, RefinedCamera,
    Refinement, RequestRecord,
};
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::submaps::Submaps;
use crate::map::surfaces::KeyframeSurfaces;
use crate::optimise::answer;
use crate::optimise::culled::RunFrames;
use crate::optimise::global::{self, Solution, Start};
use crate::optimise::kept_matches::KeptMatches;
use crate::optimise::named_loops::NamedLoops;
use crate::optimise::pending::{Pending, UnansweredRequest};
use crate::optimise::refine::{FrameHistory, Refiner};
use crate::optimise::refine_camera::refine_camera;
use crate::optimise::sample_cache::Drawn;
use crate::pairs::feature_cache::{FeatureCache, PairIds};
use crate::pairs::match_cache::MatchCache;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::VecDeque;
use tessera_geometry::{Pose, PoseBits};
use tessera_numerics::Step;

/// The optimiser: a fold over both journals plus a pure solve.
///
/// A request's input is the aligner's journal up to the record that holds it, with the corrections
/// before it, and the loops that the records of corrections name as accepted: they passed their
/// tests at their own optimum and are not tested again.
pub struct Optimiser {
    context: Context,
    state: TrackerState,
    /// Requests without an answer.
    pending: VecDeque<UnansweredRequest>,
    n_answered: u64,
    /// Loop pairs of the working map that the corrections so far named.
    named: NamedLoops,
    kept: KeptMatches,
    drawn: Drawn,
    cache: FeatureCache,
    matches: MatchCache,
}

/// The keyframes of a request, solved for.
pub(crate) struct SolvedKeyframes {
    active: Vec<KeyframeState>,
    pub(crate) solution: Solution,
    /// The keyframes that were solved for, by id.
    pub(crate) solved: Vec<KeyframePose>,
}

impl SolvedKeyframes {
    /// Poses of all keyframes of the request, by id.
    pub(crate) fn poses(&self, pending: &Pending<'_>) -> Vec<Pose> {
        all_poses(pending.keyframes, &self.solved)
    }
}

/// An optimiser between two requests.
#[derive(Debug, Serialize, Deserialize)]
pub struct OptimiserState<'a> {
    state: Cow<'a, TrackerState>,
    n_answered: u64,
    named: Cow<'a, NamedLoops>,
    kept: Cow<'a, KeptMatches>,
}

impl Optimiser {
    /// An optimiser that has seen nothing.
    pub fn new(context: Context) -> Self {
        Self {
            state: TrackerState::of_camera(&context.camera),
            context,
            pending: VecDeque::new(),
            n_answered: 0,
            named: NamedLoops::default(),
            kept: KeptMatches::default(),
            drawn: Drawn::default(),
            cache: FeatureCache::default(),
            matches: MatchCache::default(),
        }
    }

    /// An optimiser that was asked for all keyframes of a state that no journal led to.
    pub(crate) fn asked(context: Context, state: &TrackerState, request: RequestRecord) -> Self {
        let mut waiting = UnansweredRequest::new(request);
        waiting.keep(state);
        Self { pending: VecDeque::from([waiting]), ..Self::new(context) }
    }

    /// The same with what is known of its keyframes from an earlier optimisation.
    pub(crate) fn knowing(self, drawn: Drawn, cache: FeatureCache) -> Self {
        Self { drawn, cache, ..self }
    }

    /// What is known of its keyframes for a later optimisation.
    pub(crate) fn into_known(self) -> (Drawn, FeatureCache) {
        (self.drawn, self.cache)
    }

    /// Takes a record of the aligner's journal into the state.
    pub fn apply(&mut self, record: &AlignRecord) {
        self.pending.iter_mut().for_each(|waiting| waiting.keep(&self.state));
        self.state.apply(record);
        let request = match record {
            AlignRecord::Frame(frame) => frame.change.request,
            AlignRecord::End { request, .. } => *request,
            AlignRecord::Skipped(..) | AlignRecord::Correction(_) | AlignRecord::Map(_) => None,
        };
        if let Some(request) = request
            && request.request >= self.n_answered
        {
            self.pending.push_back(UnansweredRequest::new(request));
        }
    }

    /// Takes a record of its own journal into the state.
    pub fn apply_own(&mut self, record: &OptimiseRecord) {
        let correction = record.correction();
        self.n_answered = self.n_answered.max(correction.request.saturating_add(1));
        self.pending.retain(|pending| pending.request.request > correction.request);
        self.named.take(correction);
        self.kept.take(record);
    }

    /// The oldest request without an answer.
    pub fn next_request(&self) -> Option<RequestRecord> {
        self.pending.front().map(|pending| pending.request)
    }

    /// Requests answered so far.
    pub fn n_answered(&self) -> u64 {
        self.n_answered
    }

    /// Whether the aligner's journal has ended and every request is answered.
    pub fn is_done(&self) -> bool {
        self.state.is_ended && self.pending.is_empty()
    }

    /// The aligner's state as of the records taken in.
    pub fn state(&self) -> &TrackerState {
        &self.state
    }

    /// What a successor needs to go on from here; `None` while a request is pending, whose
    /// keyframes are those of an earlier moment.
    pub fn snapshot(&self) -> Option<OptimiserState<'_>> {
        self.pending.is_empty().then_some(OptimiserState {
            state: Cow::Borrowed(&self.state),
            n_answered: self.n_answered,
            named: Cow::Borrowed(&self.named),
            kept: Cow::Borrowed(&self.kept),
        })
    }

    /// An optimiser that goes on from a snapshot, as one that took in all records before it.
    pub fn restore(context: Context, snapshot: OptimiserState<'_>) -> Self {
        Self {
            context,
            state: snapshot.state.into_owned(),
            pending: VecDeque::new(),
            n_answered: snapshot.n_answered,
            named: snapshot.named.into_owned(),
            kept: snapshot.kept.into_owned(),
            drawn: Drawn::default(),
            cache: FeatureCache::default(),
            matches: MatchCache::default(),
        }
    }

    /// Answers a pending request; `history` holds the frames up to the request, and `progress` is
    /// called in each inner iteration (a heartbeat). `None` when the request is not pending.
    pub fn solve(
        &self,
        request: &RequestRecord,
        surfaces: &dyn KeyframeSurfaces,
        history: &dyn FrameHistory,
        progress: &mut dyn FnMut(),
    ) -> Option<OptimiseRecord> {
        self.context.steps.enter(Step::Prepare);
        let pending = self.find(request)?;
        let own = self.own_frames(&pending, history);
        self.solve_with(request, surfaces, (history, own.as_slice()), progress)
    }

    /// The frames of this run, where its culled keyframes are solved for.
    pub(crate) fn own_frames<'a>(
        &self,
        pending: &Pending<'_>,
        history: &'a dyn FrameHistory,
    ) -> Vec<RunFrames<'a>> {
        let (keyframes, session) = (0..pending.keyframes.len(), self.state.session);
        if pending.request.is_final { vec![RunFrames { keyframes, session, history }] } else { Vec::new() }
    }

    /// As [`Self::solve`], with the frames of all runs whose culled keyframes are solved for.
    pub(crate) fn solve_with(
        &self,
        request: &RequestRecord,
        surfaces: &dyn KeyframeSurfaces,
        (history, runs): (&dyn FrameHistory, &[RunFrames<'_>]),
        progress: &mut dyn FnMut(),
    ) -> Option<OptimiseRecord> {
        let pending = self.find(request)?;
        let keyframes = pending.keyframes;
        let solved = self.solve_keyframes(&pending, surfaces, runs, progress);
        let solution = &solved.solution;
        self.context.steps.enter(Step::Refine);
        let refined = || self.refine(&solved.poses(&pending), &solution.submaps, history);
        let frames = if request.is_final { refined() } else { Vec::new() };
        let refinement = (request.is_final && self.context.mapping.global.refine_camera)
            .then(|| self.refine_camera(keyframes, &solved.active, (surfaces, history), solution, progress));
        self.context.steps.leave();
        let changes = self.changes(request, &solution.searched);
        let correction = Correction {
            request: request.request,
            input_hash: input_hash(keyframes),
            keyframes: solved.solved,
            frames,
            refinement,
            outer_iterations: solution.outer_iterations,
            n_graduated_rounds: solution.n_rounds,
            loops: self.to_name(request, solved.solution.loops),
            submaps: solved.solution.submaps,
        };
        Some(OptimiseRecord::Incremental(Box::new(correction), changes))
    }

    /// Solves for the keyframes of a request, which may be more than the state's own: those of other runs
    /// behind them.
    pub(crate) fn solve_keyframes(
        &self,
        pending: &Pending<'_>,
        surfaces: &dyn KeyframeSurfaces,
        runs: &[RunFrames<'_>],
        progress: &mut dyn FnMut(),
    ) -> SolvedKeyframes {
        let Pending { keyframes, submaps, colour, noise, cameras, .. } = *pending;
        let context = self.context.with_colour(&colour, &noise).with_cameras(cameras.clone());
        let active: Vec<KeyframeState> = keyframes.iter().filter(|k| k.is_active()).cloned().collect();
        let ids: Vec<u32> = active.iter().map(|k| k.id).collect();
        self.cache.begin(context.colour, &ids);
        self.matches.begin(context.camera.readout_s);
        self.drawn.keep_only(&ids);
        let start = Start {
            context: &context,
            keyframes,
            active: &active,
            surfaces,
            drawn: &self.drawn,
            cache: &self.cache,
            matches: &self.matches,
            // What is final is searched anew.
            kept: if pending.request.is_final { &KeptMatches::default() } else { &self.kept },
            named: &self.named,
            runs,
        };
        let solution = global::solve(&start, submaps, progress);
        let solved = named(&active, &solution.poses, &solution.culled);
        SolvedKeyframes { active, solution, solved }
    }

    /// The loop pairs, by ids that rise, that a correction names: those that have another verdict than was named
    /// before, and in the final one all.
    pub(crate) fn to_name(&self, request: &RequestRecord, loops: Vec<LoopRecord>) -> Vec<LoopRecord> {
        if request.is_final { loops } else { self.named.not_named(loops) }
    }

    /// How the pairs of an answer differ from those before it; none of the final one, which nothing follows.
    pub(crate) fn changes(&self, request: &RequestRecord, searched: &[(PairIds, MatchPose)]) -> PairChanges {
        if request.is_final { PairChanges::default() } else { self.kept.changes(searched) }
    }

    /// Completes an answer that a base computed ([`JointMap::answer`](crate::JointMap::answer)) with what
    /// this run alone knows: the frames, where the request is the final one.
    ///
    /// # Errors
    /// Says what in it cannot be an answer to this request.
    pub fn accept(
        &self,
        request: &RequestRecord,
        (answer, changes): (Correction, PairChanges),
        history: &dyn FrameHistory,
    ) -> Result<OptimiseRecord, String> {
        let pending =
            self.find(request).ok_or_else(|| format!("request {} is not pending", request.request))?;
        answer::check(request, (pending.keyframes, pending.submaps), &answer)?;
        answer::check_pairs(pending.keyframes.len(), &changes)?;
        let poses = all_poses(pending.keyframes, &answer.keyframes);
        let refined = || self.refine(&poses, &answer.submaps, history);
        let frames = if request.is_final { refined() } else { Vec::new() };
        Ok(OptimiseRecord::IncrementalFromBase(Box::new(Correction { frames, ..answer }), changes))
    }

    /// The answer to a pending request that cannot be solved: it corrects nothing. `None` when the
    /// request is not pending.
    pub fn decline(&self, request: &RequestRecord) -> Option<Correction> {
        let Pending { keyframes, submaps, .. } = self.find(request)?;
        Some(Correction {
            request: request.request,
            input_hash: input_hash(keyframes),
            submaps: submaps.clone(),
            ..Correction::default()
        })
    }

    /// A request without an answer, with the map as it was at its record.
    pub(crate) fn find(&self, request: &RequestRecord) -> Option<Pending<'_>> {
        let waiting = self.pending.iter().find(|pending| pending.request.request == request.request)?;
        Some(waiting.asks(&self.context, &self.state))
    }

    fn refine_camera(
        &self,
        keyframes: &[KeyframeState],
        active: &[KeyframeState],
        (surfaces, history): (&dyn KeyframeSurfaces, &dyn FrameHistory),
        solution: &Solution,
        progress: &mut dyn FnMut(),
    ) -> Refinement {
        if !self.context.cameras.is_empty() {
            return Refinement::Kept("the map has keyframes of several cameras".to_owned());
        }
        match refine_camera(&self.context, active, surfaces, solution, progress) {
            Ok(found) => {
                let poses = all_poses(keyframes, &named(active, &found.world_from_camera, &[]));
                Refinement::Refined(Box::new(RefinedCamera {
                    moved_px: found.moved_px,
                    n_held: found.held.len() as u32,
                    residual_sigmas: found.residual_sigmas.into(),
                    keyframes: by_id(keyframes, &poses),
                    frames: self.refine(&poses, &solution.submaps, history),
                    camera: found.camera,
                }))
            }
            Err(error) => Refinement::Kept(error.to_string()),
        }
    }

    fn refine(&self, poses: &[Pose], submaps: &Submaps, history: &dyn FrameHistory) -> Vec<(u64, PoseBits)> {
        let keyframes = &self.state.keyframes;
        let n_map_keyframes = (self.state.n_map_keyframes as usize).min(keyframes.len());
        Refiner { poses, n_map_keyframes, keyframes, submaps }.solve(history)
    }
}

/// The poses of the active keyframes and of the culled ones that were solved for, as a correction has them.
fn named(active: &[KeyframeState], poses: &[Pose], culled: &[(u32, Pose)]) -> Vec<KeyframePose> {
    let active = active.iter().map(|k| k.id).zip(poses);
    let all = active.chain(culled.iter().map(|(id, pose)| (*id, pose)));
    let mut named: Vec<KeyframePose> =
        all.map(|(id, pose)| KeyframePose { id, world_from_camera: PoseBits::from(pose) }).collect();
    named.sort_by_key(|k| k.id);
    named
}

/// Poses of all keyframes once those that are named have theirs.
fn all_poses(keyframes: &[KeyframeState], named: &[KeyframePose]) -> Vec<Pose> {
    match corrected(keyframes, named) {
        Some((poses, _)) => poses.iter().map(Pose::from).collect(),
        None => keyframes.iter().map(|k| Pose::from(&k.world_from_camera)).collect(),
    }
}

/// The poses of all keyframes as a correction could have them.
fn by_id(keyframes: &[KeyframeState], poses: &[Pose]) -> Vec<KeyframePose> {
    let entry = |(k, pose): (&KeyframeState, &Pose)| KeyframePose {
        id: k.id,
        world_from_camera: PoseBits::from(pose),
    };
    keyframes.iter().zip(poses).map(entry).collect()
}
