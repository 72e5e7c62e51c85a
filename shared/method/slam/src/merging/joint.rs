//! The maps of several runs as one (method 12.9): each is a component of its own until a place is seen
//! from both.

use crate::map::cameras::{SessionCamera, SessionCameras};
use crate::map::context::Context;
use crate::map::input_hash::input_hash;
use crate::map::placement::apply_correction;
use crate::map::records::{AlignRecord, Correction, KeyframePose, PairChanges, RequestRecord};
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::submaps::Submaps;
use crate::map::surfaces::KeyframeSurfaces;
use crate::merging::joint_cache::JointCache;
use crate::merging::meeting::{Meeting, join_all};
use crate::optimise::answer::origins;
use crate::optimise::culled::RunFrames;
use crate::optimise::optimiser::Optimiser;
use crate::optimise::pending::Pending;
use crate::optimise::refine::{FrameHistory, Refiner};
use std::ops::Range;
use tessera_geometry::{Pose, PoseBits, Twist, compose_normalised};

/// The keyframes of several runs, numbered through in the order in which the runs were added. Each run has its
/// own camera and grid.
pub struct JointMap {
    context: Context,
    /// By session.
    cameras: Vec<SessionCamera>,
    state: TrackerState,
    runs: Vec<MemberRun>,
    cache: JointCache,
}

/// Where a run's keyframes and submaps are.
struct MemberRun {
    keyframes: Range<usize>,
    submaps: Range<u32>,
    /// Its number among all runs that keyframes are of.
    session: u32,
}

impl JointMap {
    /// A map without a keyframe.
    pub fn new(context: Context) -> Self {
        Self::knowing(context, JointCache::default())
    }

    /// A map without a keyframe, to which an earlier one left what it found out: the same map as without.
    pub fn knowing(context: Context, cache: JointCache) -> Self {
        // No keyframe is the tracker's own here.
        let state = TrackerState { session: u32::MAX, ..TrackerState::default() };
        Self { context, cameras: Vec::new(), state, runs: Vec::new(), cache }
    }

    /// What a later map of the same runs need not find out again.
    pub fn into_cache(self) -> JointCache {
        self.cache
    }

    /// A map that begins with a run's request: run 0 is that run with the keyframes that the request asks
    /// for, in its own numbers and gauge. `None` where the request is not pending.
    pub fn of_request(context: Context, optimiser: &Optimiser, request: &RequestRecord) -> Option<Self> {
        let Pending { keyframes, submaps, colour, .. } = optimiser.find(request)?;
        let (keyframes, submaps) = (keyframes.to_vec(), submaps.clone());
        let mut map = Self::new(context);
        map.add(&TrackerState { keyframes, submaps, colour, ..TrackerState::default() });
        Some(map)
    }

    /// Adds the map that a run has, as a fold over its journal, seen by the camera of this map's context.
    pub fn add(&mut self, map: &TrackerState) {
        let seen_by = self.context.session_camera();
        self.add_seen_by(map, &[seen_by]);
    }

    /// Adds the map that a run has, seen by cameras by session as [`Context::session_cameras`] has them. Those
    /// like that of the first run have its colour too.
    pub fn add_seen_by(&mut self, map: &TrackerState, seen_by: &[SessionCamera]) {
        self.know_cameras(map, seen_by);
        self.append(map);
    }

    /// Enters the camera for each session of a run that is about to be added.
    fn know_cameras(&mut self, map: &TrackerState, seen_by: &[SessionCamera]) {
        let n_before = self.state.keyframes.iter().map(|k| k.session.saturating_add(1)).max().unwrap_or(0);
        // A run has no more sessions than keyframes, and its own.
        let last = map.keyframes.iter().map(|k| k.session).chain([map.session]).max().unwrap_or(0);
        let n_own = (last as usize).min(map.keyframes.len()) + 1;
        let own = self.context.session_camera();
        self.cameras.truncate(n_before as usize);
        for session in 0..n_own {
            let seen_by = seen_by.get(session).or(seen_by.last()).unwrap_or(&own);
            // What the run itself found, of its own camera.
            let found = seen_by.colour.unwrap_or(map.colour.model);
            let is_alike = self.cameras.first().is_none_or(|first| first.is_alike(seen_by));
            let colour = if is_alike { None } else { Some(found) };
            self.cameras.push(SessionCamera { colour, ..seen_by.clone() });
        }
        let cameras = SessionCameras::new(&self.cameras);
        self.context = self.context.clone().with_cameras(cameras);
    }

    /// Adds keyframes and submaps; the first run says how colour lies.
    fn append(&mut self, map: &TrackerState) {
        let first = self.state.keyframes.len() as u32;
        let (first_submap, n_submaps) = (self.state.submaps.n(), n_submaps(map));
        if self.runs.is_empty() {
            self.state.colour = map.colour;
        }
        let session = self.state.keyframes.iter().map(|k| k.session.saturating_add(1)).max().unwrap_or(0);
        // What a map names beyond its own keyframes it must not find among those of another run.
        let n = map.keyframes.len() as u32;
        let own = |id: u32| if id < n { id.checked_add(first) } else { None };
        self.state.keyframes.extend(map.keyframes.iter().zip(first..).map(|(k, id)| {
            let mut keyframe = k.clone();
            keyframe.id = id;
            keyframe.session = k.session.saturating_add(session);
            keyframe.submap = k.submap.saturating_add(first_submap);
            keyframe.edges.retain_mut(|edge| own(edge.to).map(|to| edge.to = to).is_some());
            keyframe.alike.retain_mut(|other| own(*other).map(|id| *other = id).is_some());
            // One that moves along with a keyframe that is not there stays out of the working map.
            keyframe.anchored_to = k.anchored_to.map(|anchor| own(anchor).unwrap_or(id));
            keyframe
        }));
        if n_submaps > 0 {
            self.state.submaps.extend_to(first_submap.saturating_add(n_submaps - 1));
        }
        for submap in 0..n_submaps {
            // A component is named by one of the map's own submaps.
            let component = Some(map.submaps.component(submap)).filter(|component| *component < n_submaps);
            let [submap, component] =
                [submap, component.unwrap_or(submap)].map(|own| first_submap.saturating_add(own));
            self.state.submaps.join(submap, component);
        }
        self.runs.push(MemberRun {
            keyframes: first as usize..self.state.keyframes.len(),
            submaps: first_submap..first_submap.saturating_add(n_submaps),
            session: session.saturating_add(map.session),
        });
    }

    /// All keyframes.
    pub fn keyframes(&self) -> &[KeyframeState] {
        &self.state.keyframes
    }

    /// Which submaps are joined.
    pub fn submaps(&self) -> &Submaps {
        &self.state.submaps
    }

    /// The numbers of a run's keyframes; nothing of a run that was not added.
    pub fn keyframes_of(&self, run: usize) -> Range<usize> {
        self.runs.get(run).map_or(0..0, |run| run.keyframes.clone())
    }

    /// The run that a keyframe is of.
    pub fn run_of(&self, keyframe: u32) -> Option<usize> {
        self.runs.iter().position(|run| run.keyframes.contains(&(keyframe as usize)))
    }

    /// The component, among all runs, of a run's submap.
    pub fn component(&self, run: usize, submap: u32) -> Option<u32> {
        let joint = self.runs.get(run)?.submaps.start.checked_add(submap)?;
        Some(self.state.submaps.component(joint))
    }

    /// Joins components that share places. A join is no more than supposed until
    /// [`Self::optimise`] keeps it.
    pub fn join(&mut self, surfaces: &dyn KeyframeSurfaces, progress: &mut dyn FnMut()) -> Vec<Meeting> {
        self.cache.begin(&self.state.keyframes, self.context.cameras.colours(u32::MAX));
        join_all(&self.context, &mut self.state, surfaces, &mut self.cache.meetings, progress)
    }

    /// Solves for all keyframes in one graph, the first of each component fixed; components come apart
    /// again where the loops between them lost their weight. `None` with fewer than two keyframes. `histories`: the
    /// frames of the runs, in the order in which these were added; what culled keyframes measured holds those
    /// together that are kept.
    pub fn optimise(
        &mut self,
        surfaces: &dyn KeyframeSurfaces,
        histories: &[&dyn FrameHistory],
        progress: &mut dyn FnMut(),
    ) -> Option<Correction> {
        let n_keyframes = self.state.keyframes.len() as u32;
        let request = RequestRecord { request: 0, n_keyframes, effective_before: 0, is_final: true };
        let mut context = self.context.clone();
        context.mapping.global.refine_camera = false;
        let optimiser = (n_keyframes >= 2).then(|| Optimiser::asked(context, &self.state, request))?;
        let JointCache { drawn, features, .. } = &mut self.cache;
        let optimiser = optimiser.knowing(std::mem::take(drawn), std::mem::take(features));
        let none: &[AlignRecord] = &[];
        let mut runs = Vec::new();
        for (MemberRun { keyframes, session, .. }, history) in self.runs.iter().zip(histories) {
            runs.push(RunFrames { keyframes: keyframes.clone(), session: *session, history: *history });
        }
        let correction = optimiser.solve_with(&request, surfaces, (&none, &runs), progress);
        (*drawn, *features) = optimiser.into_known();
        let correction = correction?.into_correction();
        let _ = apply_correction(&mut self.state.keyframes, &correction);
        self.state.submaps.judge(&correction.submaps);
        Some(correction)
    }

    /// What the joint map says of one run, in that run's own numbers: a correction of all its keyframes,
    /// with every frame solved again. `map` is what was added, `history` its frames.
    pub fn correction_of(&self, run: usize, map: &TrackerState, history: &dyn FrameHistory) -> Correction {
        let keyframes = &self.state.keyframes[self.keyframes_of(run)];
        let poses: Vec<Pose> = keyframes.iter().map(|k| Pose::from(&k.world_from_camera)).collect();
        let entry =
            |(id, k): (u32, &KeyframeState)| KeyframePose { id, world_from_camera: k.world_from_camera };
        let submaps = self.submaps_of(run);
        let n_map_keyframes = (map.n_map_keyframes as usize).min(map.keyframes.len());
        let refiner =
            Refiner { poses: &poses, n_map_keyframes, keyframes: &map.keyframes, submaps: &submaps };
        Correction {
            request: u64::MAX,
            keyframes: (0..).zip(keyframes).map(entry).collect(),
            frames: refiner.solve(history),
            submaps: submaps.clone(),
            ..Correction::default()
        }
    }

    /// The answer to the request that this map began with ([`Self::of_request`]), to be called behind
    /// [`Self::join`]: a correction of run 0's keyframes in their own gauge, without frames, from one graph
    /// with the runs that share a place with it, and what became of the pairs of run 0. Where none shares a
    /// place, the bits are those of the run's own optimisation. `history` holds the frames of run 0 up to the
    /// request.
    pub fn answer(
        &self,
        optimiser: &Optimiser,
        request: &RequestRecord,
        surfaces: &dyn KeyframeSurfaces,
        history: &dyn FrameHistory,
        progress: &mut dyn FnMut(),
    ) -> Option<(Correction, PairChanges)> {
        let own = optimiser.find(request)?;
        let joint = (self.n_sharing() > 0).then(|| Pending {
            request: *request,
            keyframes: &self.state.keyframes,
            submaps: &self.state.submaps,
            colour: own.colour,
            noise: own.noise,
            cameras: &self.context.cameras,
        });
        let frames = optimiser.own_frames(&own, history);
        let asked = joint.unwrap_or(own);
        let solved = optimiser.solve_keyframes(&asked, surfaces, &frames, progress);
        let submaps = solved.solution.submaps.first(own.submaps.n());
        let poses = in_own_gauge(own.keyframes, &submaps, solved.poses(&asked));
        let mut loops = solved.solution.loops;
        loops.retain(|l| (l.newer.max(l.older) as usize) < own.keyframes.len());
        let mut searched = solved.solution.searched;
        searched.retain(|((newer, older), _)| (*newer.max(older) as usize) < own.keyframes.len());
        let origins = origins(own.keyframes, &submaps);
        let pose = |id: u32| match &own.keyframes[id as usize] {
            origin if origins.contains(&(id as usize)) => origin.world_from_camera,
            _ => PoseBits::from(&poses[id as usize]),
        };
        let own_ids = solved.solved.iter().map(|k| k.id).filter(|id| (*id as usize) < own.keyframes.len());
        let keyframes = own_ids.map(|id| KeyframePose { id, world_from_camera: pose(id) }).collect();
        let correction = Correction {
            request: request.request,
            input_hash: input_hash(own.keyframes),
            keyframes,
            frames: Vec::new(),
            loops: optimiser.to_name(request, loops),
            submaps,
            outer_iterations: solved.solution.outer_iterations,
            n_graduated_rounds: solved.solution.n_rounds,
            refinement: None,
        };
        Some((correction, optimiser.changes(request, &searched)))
    }

    /// Runs that share a place with run 0.
    pub fn n_sharing(&self) -> usize {
        let Some((own, others)) = self.runs.split_first() else { return 0 };
        let component = |submap: u32| self.state.submaps.component(submap);
        let components: Vec<u32> = own.submaps.clone().map(component).collect();
        let is_shared =
            |run: &&MemberRun| run.submaps.clone().any(|submap| components.contains(&component(submap)));
        others.iter().filter(is_shared).count()
    }

    /// A run's submaps, joined where they have a component in common among all runs.
    fn submaps_of(&self, run: usize) -> Submaps {
        let all = self.runs.get(run).map_or(0..0, |run| run.submaps.clone());
        let mut own = Submaps::apart(all.len() as u32);
        for a in all.clone() {
            for b in all.start..a {
                if self.state.submaps.component(a) == self.state.submaps.component(b) {
                    own.join(a - all.start, b - all.start);
                }
            }
        }
        own
    }
}

/// Poses of a run's keyframes, moved so that the origin of each component is where the run has it: a join
/// that was refuted leaves a component in the gauge of another one.
fn in_own_gauge(keyframes: &[KeyframeState], submaps: &Submaps, mut poses: Vec<Pose>) -> Vec<Pose> {
    poses.truncate(keyframes.len());
    for origin in origins(keyframes, submaps) {
        let old = &keyframes[origin].world_from_camera;
        if PoseBits::from(&poses[origin]) == *old {
            continue;
        }
        let own_from_solved = Pose::from(old) * poses[origin].inverse();
        let component = submaps.component(keyframes[origin].submap);
        let is_in = |k: &KeyframeState| submaps.component(k.submap) == component;
        for (pose, _) in poses.iter_mut().zip(keyframes).filter(|(_, k)| is_in(k)) {
            *pose = compose_normalised(&(own_from_solved * *pose), &Twist::default());
        }
    }
    poses
}

/// Submaps of a run; those that its keyframes name are there however old its records are.
fn n_submaps(map: &TrackerState) -> u32 {
    let named = map.keyframes.iter().map(|k| k.submap.saturating_add(1)).max().unwrap_or(0);
    named.max(map.submaps.n())
}
