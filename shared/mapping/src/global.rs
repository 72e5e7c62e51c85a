//! All keyframes with all their multi-edges at once (SPEC 5, 8).

use crate::context::Context;
use crate::degeneracy;
use crate::drawn::Drawn;
use crate::loops;
use crate::neighbours;
use crate::parts::{in_pool, map_in_parts};
use crate::recognised;
use crate::records::{LoopRecord, LoopVerdict};
use crate::robust;
use crate::state::KeyframeState;
use crate::tracker::KeyframeSurfaces;
use crate::verify::{self, KnownLoops, Side, Tested};
use tessera_geometry::{Pose, Twist, Vector6};
use tessera_registration::{
    BlockSums, BrightnessUse, Graph, KdTree, MatchLimits, Matcher, Pair, PairBlock, Queries, Sample, Sampler,
    Selection, ShutterTable, Target, gather,
};
use tessera_steps::Step;
use tessera_surface::SurfaceView;

/// The outcome of an optimisation.
pub(crate) struct Solution {
    pub(crate) poses: Vec<Pose>,
    /// Loop pairs of the last outer iteration.
    pub(crate) loops: Vec<LoopRecord>,
    pub(crate) outer_iterations: u32,
    /// Graduated rounds over all outer iterations; 0: every loop fitted at once.
    pub(crate) n_rounds: u32,
}

/// A keyframe made ready: queries at its stamp, and its readout motion as a target.
pub(crate) struct Prepared<'a> {
    pub(crate) queries: Queries,
    pub(crate) shutter: ShutterTable,
    pub(crate) surface: SurfaceView<'a>,
    pub(crate) tree: Option<KdTree>,
    /// The run that made it.
    session: u32,
}

impl Prepared<'_> {
    pub(crate) fn target(&self) -> Target<'_> {
        Target { surface: self.surface, shutter: &self.shutter, tree: self.tree.as_ref() }
    }

    pub(crate) fn side(&self) -> Side<'_> {
        Side { queries: &self.queries, target: self.target() }
    }
}

/// A pair with the tests that it had to pass, if it closes a loop.
struct Found {
    pair: Pair,
    tested: Option<Tested>,
}

/// Solves for all keyframes, the first one fixed. The same bits for any number of threads: each
/// pair is summed by itself, and pairs are added in order. Pairs in `known` are not tested again.
pub(crate) fn solve(
    context: &Context,
    keyframes: &[KeyframeState],
    surfaces: &dyn KeyframeSurfaces,
    drawn: &Drawn,
    mut known: KnownLoops,
    outer_iterations: u32,
    progress: &mut dyn FnMut(),
) -> Solution {
    let settings = &context.mapping.global;
    let mut poses: Vec<Pose> = keyframes.iter().map(|k| Pose::from(&k.world_from_camera)).collect();
    let sessions: Vec<u32> = keyframes.iter().map(|k| k.session).collect();
    context.steps.enter(Step::Prepare);
    let prepared = map_in_parts(
        keyframes,
        Sampler::default,
        |sampler, k| {
            let surface = SurfaceView { grid: context.grid, vertices: surfaces.vertices(k.id) };
            let draw = || sampler.choose(&surface, k.frame_index, &context.registration).into();
            let mut samples = Vec::new();
            let key = (k.id, k.frame_index, surface.vertices.len());
            gather(&surface, &drawn.of(key, draw), &mut samples);
            prepared_by(context, k, surface, &samples)
        },
        progress,
    );
    drawn.keep_only(&keyframes.iter().map(|k| k.id).collect::<Vec<_>>());
    let ids = |query: usize, target: usize| (keyframes[query].id, keyframes[target].id);
    let metric_factor = context.matcher().metric_factor();
    let mut loops = Vec::new();
    let mut n_rounds = 0;
    for k in 0..outer_iterations {
        let share = if outer_iterations > 1 { k as f32 / (outer_iterations - 1) as f32 } else { 1.0 };
        let near = MatchLimits::new(settings.first_distance_m, share);
        let far = MatchLimits::drifted(settings.first_distance_m, share);
        context.steps.enter(Step::Search);
        let found = map_in_parts(
            &neighbours::pairs(&poses, &sessions, settings),
            || context.matcher(),
            |matcher, &(query, target)| {
                let is_loop = loops::are_far(&context.mapping.loops, &keyframes[query], &keyframes[target]);
                let at = poses[target].inverse() * poses[query];
                let (newer, older) = (&prepared[query], &prepared[target]);
                let tested = is_loop.then(|| {
                    known
                        .get(&ids(query, target))
                        .copied()
                        .unwrap_or_else(|| verify::test(settings, matcher, &newer.side(), &older.side(), &at))
                });
                let limits = if is_loop { &far } else { &near };
                Found { pair: pair(context, matcher, (query, newer), (target, older), &at, limits), tested }
            },
            progress,
        );
        known.extend(found.iter().filter_map(|f| Some((ids(f.pair.query, f.pair.target), f.tested?))));
        loops.clear();
        let (mut pairs, mut is_loop, mut tests) = (Vec::new(), Vec::new(), Vec::new());
        for f in found {
            let is_good = f.tested.is_none_or(|t| t.verdict == LoopVerdict::Accepted);
            if f.pair.weight > 0.0 && is_good {
                pairs.push(f.pair);
                is_loop.push(f.tested.is_some());
                tests.push(f.tested);
            } else if let Some(tested) = f.tested {
                loops.push(loop_record(keyframes, &f.pair, &tested, 0.0, 0.0));
            }
        }
        if k == 0 {
            let mut is_closed = vec![false; keyframes.len()];
            for (pair, _) in pairs.iter().zip(&is_loop).filter(|(_, is_loop)| **is_loop) {
                (is_closed[pair.query], is_closed[pair.target]) = (true, true);
            }
            let open: Vec<usize> = (0..keyframes.len()).filter(|&i| !is_closed[i]).collect();
            context.steps.enter(Step::Recognise);
            for (pair, tested) in recognised::pairs(context, keyframes, &prepared, &open, progress) {
                pairs.push(pair);
                is_loop.push(true);
                tests.push(Some(tested));
                // The poses will move: what was refused where they were may fit then.
                known.retain(|_, tested| tested.verdict == LoopVerdict::Accepted);
            }
        }
        context.steps.enter(Step::Solve);
        let mut is_fixed = vec![false; poses.len()];
        is_fixed[0] = true;
        let mut graph = Graph {
            poses: poses.clone(),
            is_fixed,
            pairs,
            priors: Vec::new(),
            isa: context.registration.isa,
        };
        let inner_iterations = context.registration.inner_iterations;
        let report = in_pool(progress, |progress| {
            robust::optimise(&mut graph, &is_loop, settings, metric_factor, inner_iterations, progress)
        });
        // Without a solution the poses stay as they are: a correction that changes nothing.
        if let Ok(report) = report {
            n_rounds += report.n_rounds;
            poses = graph.poses;
            for ((pair, tested), residual) in graph.pairs.iter().zip(&tests).zip(&report.residuals_sigmas) {
                let Some(tested) = tested else { continue };
                loops.push(loop_record(keyframes, pair, tested, *residual, pair.weight));
            }
        }
    }
    context.steps.leave();
    loops.sort_by_key(|l| (l.newer, l.older));
    Solution { poses, loops, outer_iterations, n_rounds }
}

/// Matches a pair; weight 0 where it overlaps too little to count.
fn pair(
    context: &Context,
    matcher: &mut Matcher,
    (query, newer): (usize, &Prepared<'_>),
    (target, older): (usize, &Prepared<'_>),
    target_from_query: &Pose,
    limits: &MatchLimits,
) -> Pair {
    let settings = &context.mapping.global;
    // Each pair takes another choice of the samples.
    let selection = Selection { count: settings.queries_per_pair as usize, shift: target };
    let factor = matcher.metric_factor();
    let mut find = |brightness: bool| {
        let limits = MatchLimits { brightness, ..*limits };
        matcher.match_pair(&newer.queries, selection, &older.target(), target_from_query, &limits)
    };
    let brightness = context.registration.weight.brightness;
    let (mut sums, mut report) = find(brightness == BrightnessUse::Always);
    if brightness == BrightnessUse::WhereFree && leaves_free(context, factor, target_from_query, &sums) {
        (sums, report) = find(true);
    }
    let overlap = f64::from(report.n_matches) / f64::from(report.n_queries.max(1));
    let is_neighbour = query == target + 1 && newer.session == older.session && report.n_matches >= 30;
    let weight = if overlap >= settings.min_overlap || is_neighbour { 1.0 } else { 0.0 };
    Pair { query, target, block: PairBlock::new(target_from_query, &sums), weight }
}

/// Whether the matches of a pair leave a direction of its motion free.
fn leaves_free(context: &Context, factor: f64, target_from_query: &Pose, sums: &BlockSums) -> bool {
    let window = &context.mapping.window;
    let (information, ..) = PairBlock::new(target_from_query, sums).linearise(target_from_query);
    let metric = information / (factor * window.correlation);
    let centroid = degeneracy::centroid(std::iter::once(sums));
    !degeneracy::free_directions(window, &metric, &centroid).is_empty()
}

fn loop_record(
    keyframes: &[KeyframeState],
    pair: &Pair,
    tested: &Tested,
    residual_sigmas: f64,
    weight: f64,
) -> LoopRecord {
    let verdict = match tested.verdict {
        LoopVerdict::Accepted if pair.weight == 0.0 && residual_sigmas > 0.0 => LoopVerdict::Outvoted,
        LoopVerdict::Accepted if pair.weight == 0.0 => LoopVerdict::LittleOverlap,
        verdict => verdict,
    };
    LoopRecord {
        newer: keyframes[pair.query].id,
        older: keyframes[pair.target].id,
        overlap: tested.overlap,
        in_front: tested.in_front,
        inconsistency_sigmas: tested.inconsistency_sigmas,
        residual_sigmas,
        weight,
        verdict,
    }
}

pub(crate) fn prepare<'a>(
    context: &Context,
    sampler: &mut Sampler,
    keyframe: &KeyframeState,
    surfaces: &'a dyn KeyframeSurfaces,
) -> Prepared<'a> {
    let surface = SurfaceView { grid: context.grid, vertices: surfaces.vertices(keyframe.id) };
    let mut samples = Vec::new();
    sampler.draw(&surface, keyframe.frame_index, &context.registration, &mut samples);
    prepared_by(context, keyframe, surface, &samples)
}

fn prepared_by<'a>(
    context: &Context,
    keyframe: &KeyframeState,
    surface: SurfaceView<'a>,
    samples: &[Sample],
) -> Prepared<'a> {
    let shutter = context.shutter(&Twist::from_vector(&Vector6::from_column_slice(&keyframe.velocity)));
    let mut queries = Queries::default();
    queries.fill(samples, &shutter);
    let tree = context.tree(&surface, &shutter);
    Prepared { queries, shutter, surface, tree, session: keyframe.session }
}
