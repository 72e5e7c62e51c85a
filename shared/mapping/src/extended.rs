//! A conflict at a loop, and the extended window that settles it (SPEC 7; Holz and Behnke 2015,
//! III-G): the new frame and all keyframes of its window move, their neighbours in the graph stay.

use crate::attempt::Attempt;
use crate::global::{Prepared, prepare};
use crate::loops;
use crate::records::{FrameRecord, KeyframePose, KeyframeRecord, State};
use crate::state::KeyframeState;
use crate::tracker::{FrameSurface, Surfaces, Tracker};
use crate::window::Member;
use std::collections::{BTreeMap, BTreeSet};
use tessera_geometry::{Pose, PoseBits, Twist, compose_normalised, translation_rotation_norms};
use tessera_registration::{
    Graph, MatchLimits, Matcher, Pair, PairBlock, Queries, Sample, Sampler, Selection,
};

/// Searches, from wide limits to the last.
const OUTER_ITERATIONS: u32 = 3;
/// Most neighbours that hold the window.
const MOST_BORDER: usize = 12;

/// A keyframe of the extended window.
struct Vertex<'a> {
    id: u32,
    is_fixed: bool,
    prepared: Prepared<'a>,
}

impl Tracker {
    /// Where the frame would be without the keyframes of long ago, and how far from there it is:
    /// metres and radians. `None` where the window holds no loop, or nothing else.
    fn conflict(
        &self,
        frame: &FrameSurface<'_>,
        attempt: &Attempt,
        record: &FrameRecord,
    ) -> Option<(f64, f64)> {
        let settings = &self.context.mapping.loops;
        let is_old =
            |member: &Member| match member {
                Member::Keyframe(id) => self.state.keyframes.get(*id as usize).is_some_and(|k| {
                    loops::is_loop(settings, &self.state, k, frame.index, frame.stamp_nanos)
                }),
                Member::Recent(_) => false,
            };
        let n_old = attempt.members.iter().filter(|m| is_old(m)).count();
        if n_old == 0 || n_old == attempt.members.len() || attempt.state != State::Tracking {
            return None;
        }
        let with = attempt.alignment.world_from_camera;
        let mut graph = Graph { poses: vec![with], is_fixed: vec![false], ..Graph::default() };
        for (member, (origin, sums)) in attempt.members.iter().zip(&attempt.alignment.blocks) {
            if !is_old(member) {
                graph.poses.push(self.member_pose(*member, record)?);
                graph.is_fixed.push(true);
                let target = graph.poses.len() - 1;
                graph.pairs.push(Pair { query: 0, target, block: PairBlock::new(origin, sums), weight: 1.0 });
            }
        }
        graph.optimise(self.context.registration.inner_iterations, &mut || ()).ok()?;
        Some(translation_rotation_norms(&(graph.poses[0].inverse() * with)))
    }

    fn member_pose(&self, member: Member, record: &FrameRecord) -> Option<Pose> {
        match member {
            Member::Recent(place) => self.state.recent.get(place).map(|r| Pose::from(&r.world_from_camera)),
            Member::Keyframe(id) => {
                let known = self.state.keyframes.get(id as usize).map(|k| &k.world_from_camera);
                let made = record.new_keyframe.as_ref().filter(|k| k.id == id).map(|k| &k.world_from_camera);
                known.or(made).map(Pose::from)
            }
        }
    }

    /// The record of a frame whose window contradicts itself: the frame and the window's keyframes
    /// solved for at once. Nothing changes without a conflict, while a correction is under way (it
    /// decides), or without a solution.
    pub(crate) fn settled(
        &self,
        frame: &FrameSurface<'_>,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        attempt: &Attempt,
        record: FrameRecord,
    ) -> FrameRecord {
        let settings = &self.context.mapping.loops;
        // One attempt for each keyframe: a conflict that stays is the optimiser's.
        let is_new = self.state.keyframes.len() as u32 > self.state.n_keyframes_at_request;
        if self.state.pending.is_some() || !is_new || !settings.extended_window {
            return record;
        }
        let Some((jump_m, jump_rad)) = self.conflict(frame, attempt, &record) else { return record };
        if jump_m <= settings.conflict_translation_m
            && jump_rad <= settings.conflict_rotation_deg.to_radians()
        {
            return record;
        }
        let vertices = self.vertices(attempt, surfaces);
        let Some(poses) = self.solve_extended(samples, attempt, &vertices) else { return record };
        let Some((world_from_camera, keyframe_poses)) = poses.split_last() else { return record };
        let moved: Vec<KeyframePose> = vertices
            .iter()
            .zip(keyframe_poses)
            .filter(|(v, _)| !v.is_fixed)
            .map(|(v, pose)| KeyframePose { id: v.id, world_from_camera: PoseBits::from(pose) })
            .collect();
        if moved.is_empty() {
            return record;
        }
        let n_moved = moved.len();
        let moved = self.with_hanging(moved);
        let normal = |pose: &Pose| PoseBits::from(&compose_normalised(pose, &Twist::default()));
        let new_from_old = *world_from_camera * Pose::from(&record.world_from_camera).inverse();
        let world_from_odom = new_from_old * Pose::from(&record.world_from_odom);
        // A keyframe made just now goes with the frame.
        let new_keyframe = record.new_keyframe.clone().map(|keyframe| KeyframeRecord {
            world_from_camera: normal(&(new_from_old * Pose::from(&keyframe.world_from_camera))),
            ..keyframe
        });
        let pose_of = |id: u32| {
            let moved = moved.iter().find(|k| k.id == id).map(|k| &k.world_from_camera);
            let made = new_keyframe.as_ref().filter(|k| k.id == id).map(|k| &k.world_from_camera);
            let known = self.state.keyframes.get(id as usize).map(|k| &k.world_from_camera);
            moved.or(made).or(known).map(Pose::from)
        };
        let Some(world_from_keyframe) = pose_of(record.keyframe) else { return record };
        let said = format!(
            "a conflict of {jump_m:.3} m and {:.2} deg with keyframes of long ago; {} moved",
            jump_rad.to_degrees(),
            n_moved
        );
        FrameRecord {
            reason: if record.reason.is_empty() { said } else { format!("{}; {said}", record.reason) },
            world_from_camera: normal(world_from_camera),
            world_from_odom: normal(&world_from_odom),
            keyframe_from_camera: normal(&(world_from_keyframe.inverse() * world_from_camera)),
            new_keyframe,
            moved,
            ..record
        }
    }

    /// Keyframes that moved, and behind them those that hang on them.
    fn with_hanging(&self, mut moved: Vec<KeyframePose>) -> Vec<KeyframePose> {
        let keyframes = &self.state.keyframes;
        for k in 0..moved.len() {
            let KeyframePose { id, world_from_camera } = moved[k];
            let Some(anchor) = keyframes.get(id as usize) else { continue };
            let new_from_old =
                Pose::from(&world_from_camera) * Pose::from(&anchor.world_from_camera).inverse();
            moved.extend(keyframes.iter().filter(|k| k.hangs_on == Some(id)).map(|k| {
                let pose = new_from_old * Pose::from(&k.world_from_camera);
                let pose = compose_normalised(&pose, &Twist::default());
                KeyframePose { id: k.id, world_from_camera: PoseBits::from(&pose) }
            }));
        }
        moved
    }

    /// The window's keyframes, free, and their neighbours in the graph, fixed; the oldest of the
    /// window where it has no neighbours.
    fn vertices<'a>(&'a self, attempt: &Attempt, surfaces: &Surfaces<'a>) -> Vec<Vertex<'a>> {
        let keyframes = &self.state.keyframes;
        let window: BTreeSet<u32> = attempt
            .members
            .iter()
            .filter_map(|m| if let Member::Keyframe(id) = m { Some(*id) } else { None })
            .filter(|id| (*id as usize) < keyframes.len())
            .collect();
        let mut border: BTreeMap<u32, u32> = BTreeMap::new();
        for keyframe in keyframes {
            let older = keyframe.id.checked_sub(1);
            for to in keyframe.edges.iter().map(|e| e.to).chain(older) {
                for (inside, outside) in [(keyframe.id, to), (to, keyframe.id)] {
                    let is_active = keyframes.get(outside as usize).is_some_and(KeyframeState::is_active);
                    if is_active && window.contains(&inside) && !window.contains(&outside) {
                        *border.entry(outside).or_default() += 1;
                    }
                }
            }
        }
        // Those that hold most of the window first.
        let mut border: Vec<(u32, u32)> = border.into_iter().map(|(id, n)| (u32::MAX - n, id)).collect();
        border.sort_unstable();
        border.truncate(MOST_BORDER);
        let held = if border.is_empty() { window.first().copied() } else { None };
        // The first keyframe is the map's origin.
        let mut ids: Vec<(u32, bool)> = window.iter().map(|&id| (id, id == 0 || held == Some(id))).collect();
        ids.extend(border.into_iter().map(|(_, id)| (id, true)));
        ids.sort_unstable();
        let mut sampler = Sampler::default();
        ids.into_iter()
            .map(|(id, is_fixed)| {
                let keyframe = &keyframes[id as usize];
                Vertex {
                    id,
                    is_fixed,
                    prepared: prepare(&self.context, &mut sampler, keyframe, surfaces.keyframes),
                }
            })
            .collect()
    }

    /// Poses of the vertices and, last, of the frame.
    fn solve_extended(
        &self,
        samples: &[Sample],
        attempt: &Attempt,
        vertices: &[Vertex<'_>],
    ) -> Option<Vec<Pose>> {
        let pose_of = |id: u32| Pose::from(&self.state.keyframes[id as usize].world_from_camera);
        let mut graph = Graph { isa: self.context.registration.isa, ..Graph::default() };
        graph.poses.extend(vertices.iter().map(|v| pose_of(v.id)));
        graph.is_fixed.extend(vertices.iter().map(|v| v.is_fixed));
        graph.poses.push(attempt.alignment.world_from_camera);
        graph.is_fixed.push(false);
        let frame = vertices.len();
        let mut queries = Queries::default();
        queries.fill(samples, &self.context.shutter(&attempt.alignment.velocity));
        let mut matcher = self.context.matcher();
        let settings = &self.context.mapping.global;
        for k in 0..OUTER_ITERATIONS {
            let share = k as f32 / (OUTER_ITERATIONS - 1) as f32;
            let limits = MatchLimits::new(settings.first_distance_m, share);
            graph.pairs.clear();
            for (target, older) in vertices.iter().enumerate() {
                if !older.is_fixed {
                    graph.pairs.extend(self.pair(
                        &mut matcher,
                        &graph,
                        &queries,
                        frame,
                        target,
                        older,
                        &limits,
                    ));
                }
                for (query, newer) in vertices.iter().enumerate().skip(target + 1) {
                    if older.is_fixed && newer.is_fixed {
                        continue;
                    }
                    let queries = &newer.prepared.queries;
                    graph.pairs.extend(self.pair(
                        &mut matcher,
                        &graph,
                        queries,
                        query,
                        target,
                        older,
                        &limits,
                    ));
                }
            }
            graph.optimise(self.context.registration.inner_iterations, &mut || ()).ok()?;
        }
        Some(graph.poses)
    }

    #[expect(clippy::too_many_arguments, reason = "both sides of a pair, and how it is searched")]
    fn pair(
        &self,
        matcher: &mut Matcher,
        graph: &Graph,
        queries: &Queries,
        query: usize,
        target: usize,
        older: &Vertex<'_>,
        limits: &MatchLimits,
    ) -> Option<Pair> {
        let settings = &self.context.mapping.global;
        let selection = Selection { count: settings.queries_per_pair as usize, shift: target };
        let at = graph.poses[target].inverse() * graph.poses[query];
        let (sums, report) = matcher.match_pair(queries, selection, &older.prepared.target(), &at, limits);
        let overlap = f64::from(report.n_matches) / f64::from(report.n_queries.max(1));
        let block = PairBlock::new(&at, &sums);
        (overlap >= settings.min_overlap).then_some(Pair { query, target, block, weight: 1.0 })
    }
}
