//! The extended window (III-G; method 7) as a description for the one outer loop: the new frame and
//! the keyframes of its window are free, their neighbours in the graph are fixed.

use crate::loops::keyframe_pair::PairSearch;
use crate::loops::matchable::Matchable;
use crate::map::map_view::MapView;
use crate::map::state::KeyframeState;
use crate::settings::GlobalSettings;
use crate::tracking::input::Surfaces;
use crate::tracking::tracker::Tracker;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::WindowAlignment;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};
use tessera_geometry::Pose;
use tessera_graph::{INNER_ITERATIONS, MultiEdge, OuterIteration, Pair, Schedule};
use tessera_registration::{MatchLimits, Queries, Sample, Sampler};
use tessera_surface::Vertex;

/// Outer iterations, from wide limits to the tightest.
const OUTER_ITERATIONS: u32 = 3;
/// Most neighbours that hold the window.
const MOST_BORDER: usize = 12;

/// A keyframe of the extended window.
pub(crate) struct WindowPose<'a> {
    pub(crate) id: u32,
    session: u32,
    submap: u32,
    pub(crate) is_fixed: bool,
    matchable: Matchable<'a>,
    vertices: Cow<'a, [Vertex]>,
}

impl WindowPose<'_> {
    /// Whether it is the next keyframe after another in the same run.
    fn follows(&self, older: &Self) -> bool {
        self.id == older.id + 1 && self.session == older.session && self.submap == older.submap
    }
}

impl Tracker {
    /// The window's keyframes, free, and their neighbours in the graph, fixed; the oldest of the
    /// window where it has no neighbours.
    pub(crate) fn extended_window<'a>(
        &'a self,
        attempt: &WindowAlignment,
        surfaces: &Surfaces<'a>,
    ) -> Vec<WindowPose<'a>> {
        let keyframes = &self.state.keyframes;
        let window: BTreeSet<u32> = attempt
            .members
            .iter()
            .filter_map(|m| if let Member::Keyframe(id) = m { Some(*id) } else { None })
            .filter(|id| (*id as usize) < keyframes.len())
            .collect();
        let map = MapView::from(&self.state);
        let mut border: BTreeMap<u32, u32> = BTreeMap::new();
        for keyframe in keyframes {
            let older = keyframe.id.checked_sub(1);
            for to in keyframe.edges.iter().map(|e| e.to).chain(older) {
                for (inside, outside) in [(keyframe.id, to), (to, keyframe.id)] {
                    let is_active =
                        keyframes.get(outside as usize).is_some_and(|k| k.is_active() && map.contains(k));
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
        let origin = map.keyframes().next().map(|k| k.id);
        let mut ids: Vec<(u32, bool)> =
            window.iter().map(|&id| (id, Some(id) == origin || held == Some(id))).collect();
        ids.extend(border.into_iter().map(|(_, id)| (id, true)));
        ids.sort_unstable();
        let mut sampler = Sampler::default();
        ids.into_iter()
            .map(|(id, is_fixed)| {
                let keyframe = &keyframes[id as usize];
                let matchable = Matchable::new(&self.context, &mut sampler, keyframe, surfaces.keyframes);
                let KeyframeState { session, submap, .. } = *keyframe;
                let vertices = matchable.vertices();
                WindowPose { id, session, submap, is_fixed, matchable, vertices }
            })
            .collect()
    }

    /// Poses of the vertices and, last, of the frame; `None` without a solution.
    pub(crate) fn solve_extended(
        &self,
        samples: &[Sample],
        attempt: &WindowAlignment,
        vertices: &[WindowPose<'_>],
    ) -> Option<Vec<Pose>> {
        let pose_of = |v: &WindowPose<'_>| Pose::from(&self.state.keyframes[v.id as usize].world_from_camera);
        let mut queries = Queries::default();
        queries.fill(samples, &self.context.shutter(&attempt.alignment.velocity));
        let mut matcher = self.context.matcher();
        let first_distance_m = GlobalSettings::FIRST_DISTANCE_M;
        let mut associate = |poses: &[Pose], iteration: OuterIteration| -> Vec<Pair> {
            let limits = MatchLimits::new(first_distance_m, iteration.tightness);
            let searches = searches(vertices, &queries, limits);
            let pairs = searches.iter().map(|search| search.find(&self.context, &mut matcher, poses));
            pairs.filter(|pair| pair.weight > 0.0).collect()
        };
        let problem = MultiEdge {
            poses: vertices.iter().map(pose_of).chain([attempt.alignment.world_from_camera]).collect(),
            is_fixed: vertices.iter().map(|v| v.is_fixed).chain([false]).collect(),
            priors: Vec::new(),
            schedule: Schedule::shrinking(OUTER_ITERATIONS, INNER_ITERATIONS),
            kernel: None,
            isa: self.context.registration.isa,
        };
        let solved = problem.solve(&mut associate, &mut || ());
        solved.is_solved.then_some(solved.graph.poses)
    }
}

/// The pairs of an extended window: the frame, whose samples are `queries`, with each free keyframe,
/// and all pairs of keyframes that are not both fixed. The surface searched is the older one.
fn searches<'a>(
    vertices: &'a [WindowPose<'_>],
    queries: &'a Queries,
    limits: MatchLimits,
) -> Vec<PairSearch<'a>> {
    let frame = vertices.len();
    let mut searches = Vec::new();
    for (target, older) in vertices.iter().enumerate() {
        let mut search = |query: usize, queries: &'a Queries, is_consecutive: bool| {
            let surface = older.matchable.target(&older.vertices);
            searches.push(PairSearch {
                query,
                target,
                queries,
                surface,
                is_consecutive,
                limits,
                features: None,
            });
        };
        if !older.is_fixed {
            search(frame, queries, false);
        }
        for (query, newer) in vertices.iter().enumerate().skip(target + 1) {
            if !(older.is_fixed && newer.is_fixed) {
                search(query, &newer.matchable.queries, newer.follows(older));
            }
        }
    }
    searches
}

#[cfg(test)]
mod tests;
