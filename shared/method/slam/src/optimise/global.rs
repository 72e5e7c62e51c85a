//! Global optimisation (III-G; method 8) as a description for the one outer loop: all keyframes are
//! free but the first of each component, and loops are weighed by graduated non-convexity.

use crate::evidence::pose_agreement::FAR_M;
use crate::evidence::sequential::TestVerdict;
use crate::map::context::Context;
use crate::map::records::{LoopRecord, LoopVerdict, MatchPose};
use crate::map::state::KeyframeState;
use crate::map::submaps::{Submaps, gauges};
use crate::map::surfaces::KeyframeSurfaces;
use crate::optimise::association::{KeyframeAssociation, Keyframes};
use crate::optimise::culled::{self, CulledKeyframes, RunFrames};
use crate::optimise::gravity::Gravity;
use crate::optimise::held::held;
use crate::optimise::kept_matches::KeptMatches;
use crate::optimise::matchables::Matchables;
use crate::optimise::named_loops::NamedLoops;
use crate::optimise::sample_cache::Drawn;
use crate::pairs::feature_cache::{FeatureCache, PairIds};
use crate::pairs::match_cache::MatchCache;
use crate::settings::GlobalSettings;
use crate::submaps::brought_together;
use tessera_geometry::Pose;
use tessera_graph::{GemanMcClure, INNER_ITERATIONS, MultiEdge, Schedule};

/// The outcome of an optimisation.
pub(crate) struct Solution {
    /// Poses of the active keyframes.
    pub(crate) poses: Vec<Pose>,
    /// Poses of the culled keyframes that were solved for, by id.
    pub(crate) culled: Vec<(u32, Pose)>,
    /// Loop pairs of the last outer iteration.
    pub(crate) loops: Vec<LoopRecord>,
    pub(crate) outer_iterations: u32,
    /// The submaps, apart where no accepted loop holds them together.
    pub(crate) submaps: Submaps,
    /// Graduated rounds over all outer iterations; 0: every loop fitted at once.
    pub(crate) n_rounds: u32,
    /// Pairs by appearance, and how far each was from where the poses had it, metres.
    pub(crate) recognised: Vec<(PairIds, f64)>,
    /// Where the matches of its pairs were searched, or their loops refused, by their ids.
    pub(crate) searched: Vec<(PairIds, MatchPose)>,
}

/// What an optimisation starts from.
#[derive(Clone, Copy)]
pub(crate) struct Start<'a> {
    pub(crate) context: &'a Context,
    /// All keyframes, by id.
    pub(crate) keyframes: &'a [KeyframeState],
    /// Those that others may be aligned to.
    pub(crate) active: &'a [KeyframeState],
    pub(crate) surfaces: &'a dyn KeyframeSurfaces,
    pub(crate) drawn: &'a Drawn,
    pub(crate) cache: &'a FeatureCache,
    pub(crate) matches: &'a MatchCache,
    pub(crate) kept: &'a KeptMatches,
    /// Loops that earlier corrections named.
    pub(crate) named: &'a NamedLoops,
    /// The frames of the runs whose culled keyframes are solved for as well; others move along with their anchors.
    pub(crate) runs: &'a [RunFrames<'a>],
}

/// Solves for all active keyframes. Where that takes all weight from the loops that hold submaps
/// together, their join is refuted, and they are solved for again, apart.
pub(crate) fn solve(start: &Start<'_>, submaps: &Submaps, progress: &mut dyn FnMut()) -> Solution {
    let solution = solve_uncontradicted(start, submaps, progress);
    if solution.submaps == *submaps {
        return solution;
    }
    let submaps = &solution.submaps;
    let apart = solve_uncontradicted(start, submaps, progress);
    // The loops that were refused are part of the answer.
    let submap_of = |id: u32| start.keyframes.get(id as usize).map_or(0, |k| submaps.component(k.submap));
    let refused = solution.loops.iter().filter(|l| submap_of(l.newer) != submap_of(l.older));
    let mut loops: Vec<LoopRecord> = apart.loops.iter().chain(refused).copied().collect();
    loops.sort_by_key(|l| (l.newer, l.older));
    Solution { loops, ..apart }
}

/// Solves for all active keyframes. Where pairs by appearance bring keyframes together that contradict each other,
/// they are solved for again without the farthest of those pairs.
fn solve_uncontradicted(start: &Start<'_>, submaps: &Submaps, progress: &mut dyn FnMut()) -> Solution {
    let keyframes = (start.active, &submaps.origins(start.active)[..]);
    let before: Vec<Pose> = start.active.iter().map(|k| Pose::from(&k.world_from_camera)).collect();
    let (mut most_apart_m, mut refused) = (f64::INFINITY, Vec::new());
    loop {
        let mut solution = solve_joined(start, submaps, most_apart_m, progress);
        let poses = [&before[..], &solution.poses];
        let farthest_m = solution.recognised.iter().map(|(_, apart_m)| *apart_m).fold(0.0, f64::max);
        // From nowhere there is no half of the way.
        let verdict = if farthest_m > FAR_M && farthest_m.is_finite() {
            brought_together::verdict(start.context, keyframes, start.surfaces, poses)
        } else {
            TestVerdict::Accepted
        };
        if verdict == TestVerdict::Accepted {
            // The pairs that were refused are part of the answer: of the verdicts on a pair the last counts.
            solution.loops.extend(refused);
            solution.loops.sort_by_key(|l| (l.newer, l.older));
            return solution;
        }
        most_apart_m = 0.5 * farthest_m;
        // What is undecided is left out, and asked again with more keyframes.
        if verdict == TestVerdict::Rejected {
            refused.extend(refused_pairs(&solution, most_apart_m));
        }
    }
}

/// The pairs by appearance that are farther from where the poses have them than what is left.
fn refused_pairs(solution: &Solution, most_apart_m: f64) -> impl Iterator<Item = LoopRecord> + '_ {
    let far = solution.recognised.iter().filter(move |(_, apart_m)| *apart_m > most_apart_m);
    far.filter_map(|(ids, _)| {
        let named = solution.loops.iter().rfind(|l| (l.newer, l.older) == *ids)?;
        Some(LoopRecord { weight: 0.0, verdict: LoopVerdict::Contradicted, ..*named })
    })
}

/// Solves for all active keyframes, the first one of each component fixed. The same bits for any
/// number of threads: each pair is summed by itself, and pairs are added in order. Without a solution
/// the poses stay as they are: a correction that changes nothing.
fn solve_joined(
    start: &Start<'_>,
    submaps: &Submaps,
    most_apart_m: f64,
    progress: &mut dyn FnMut(),
) -> Solution {
    let Start { context, active: keyframes, .. } = *start;
    let origins = submaps.origins(keyframes);
    let mut culled = CulledKeyframes::of(context, start.keyframes, submaps, start.runs);
    let vertices = keyframes.iter().chain(culled.ids().iter().map(|id| &start.keyframes[*id as usize]));
    let vertices: Vec<&KeyframeState> = vertices.collect();
    let gravity = Gravity::of(context, &vertices, submaps);
    let poses = vertices.iter().map(|k| Pose::from(&k.world_from_camera));
    let poses: Vec<Pose> = poses.chain(gravity.instruments).collect();
    let mut is_fixed = gauges(&origins);
    is_fixed.resize(poses.len(), false);
    let problem = MultiEdge {
        poses,
        is_fixed,
        priors: gravity.priors,
        ups: gravity.ups,
        schedule: Schedule::shrinking(GlobalSettings::OUTER_ITERATIONS, INNER_ITERATIONS),
        kernel: Some(GemanMcClure {
            limit_sigmas: GlobalSettings::LOOP_RESIDUAL_SIGMAS,
            metric_factor: context.matcher().metric_factor(),
        }),
        isa: context.registration.isa,
    };
    let of = Keyframes {
        context,
        keyframes,
        origins: &origins,
        matchables: Matchables::new(context, keyframes, start.surfaces, start.drawn),
        cache: start.cache,
        matches: start.matches,
        named: start.named,
        kept: start.kept,
    };
    let mut association = KeyframeAssociation::new(of);
    let weight = culled::weight(&context.mapping.keyframe, keyframes.len());
    association.fixed_pairs = culled.take_pairs(keyframes, weight);
    association.most_apart_m = most_apart_m;
    let solved = problem.solve(&mut association, progress);
    context.steps.leave();
    let recognised = std::mem::take(&mut association.recognised);
    let loops = association.loop_records(&solved);
    association.keep_matches();
    let searched = association.searched();
    let (outer_iterations, n_rounds) = (solved.outer_iterations, solved.n_rounds);
    let held = held(submaps.n(), &loops, start.keyframes);
    let submaps = if solved.is_solved { held } else { submaps.clone() };
    let mut poses = solved.graph.poses;
    let culled = culled.ids().iter().copied().zip(poses.split_off(keyframes.len())).collect();
    Solution { poses, culled, loops, submaps, outer_iterations, n_rounds, recognised, searched }
}
