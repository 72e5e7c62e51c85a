//! Each kernel by itself, on one thread: `cargo bench --bench kernels`.

mod common;
#[path = "common/pose_graph.rs"]
mod pose_graph;

use common::frames;
use divan::Bencher;
use divan::counter::ItemsCount;
use tessera_geometry::{DepthNoise, Pose, Twist, exp};
use tessera_graph::PairBlock;
use tessera_numerics::Step;
use tessera_offline::Method;
use tessera_registration::{
    GridCamera, KdTree, MatchLimits, Matcher, Queries, Sample, Sampler, Selection, ShutterTable, Target,
};
use tessera_surface::{Grid, Reconstructor, SurfaceSettings, SurfaceView, Vertex, packed};

fn main() {
    divan::main();
}

/// Pixels between vertices: the whole image, and the default.
const STEPS: [u32; 2] = [1, 4];

fn step(bencher: Bencher<'_, '_>, step: u32, kernel: Step) {
    let data = frames();
    let settings = SurfaceSettings { step, ..SurfaceSettings::default() };
    let mut reconstructor = Reconstructor::new(&data.camera, &settings).expect("good settings");
    let mut out = vec![Vertex::default(); reconstructor.grid().len()];
    let frame = &data.frames[0];
    let colour = frame.colour.as_deref();
    reconstructor.reconstruct(&frame.depth, colour, &mut out);
    for before in Reconstructor::STEPS.into_iter().take_while(|&s| s != kernel) {
        reconstructor.run_step(before, &frame.depth, colour, &mut out);
    }
    bencher
        .counter(ItemsCount::new(reconstructor.grid().len()))
        .bench_local(|| reconstructor.run_step(kernel, &frame.depth, colour, &mut out));
}

#[divan::bench(args = STEPS)]
fn cloud(bencher: Bencher<'_, '_>, n: u32) {
    step(bencher, n, Step::Cloud);
}

#[divan::bench(args = STEPS)]
fn mesh(bencher: Bencher<'_, '_>, n: u32) {
    step(bencher, n, Step::Mesh);
}

#[divan::bench(args = STEPS)]
fn normals(bencher: Bencher<'_, '_>, n: u32) {
    step(bencher, n, Step::Normals);
}

#[divan::bench(args = STEPS)]
fn filter(bencher: Bencher<'_, '_>, n: u32) {
    step(bencher, n, Step::Filter);
}

#[divan::bench(args = STEPS)]
fn vertices(bencher: Bencher<'_, '_>, n: u32) {
    step(bencher, n, Step::Vertices);
}

/// Two surfaces one frame apart, and what a search between them needs.
struct PairOfFrames {
    method: Method,
    grid: Grid,
    surfaces: [Vec<Vertex>; 2],
    shutter: ShutterTable,
    queries: Queries,
    matcher: Matcher,
}

impl PairOfFrames {
    fn new() -> Self {
        let (data, method) = (frames(), Method::default());
        let grid = Reconstructor::new(&data.camera, &method.surface).expect("good settings").grid();
        let surfaces = [0, 1].map(|i| common::surface(&data.camera, &method, &data.frames[i]));
        // Cells are averaged: their measurement lies in the cell's middle.
        let offset_px = (f64::from(method.surface.step) - 1.0) / 2.0;
        let shutter = ShutterTable::new(&data.camera, &Twist::default(), grid.height, grid.step, offset_px);
        let mut queries = Queries::default();
        queries.fill(&samples(&method, grid, &surfaces[1]), &shutter);
        let camera = GridCamera::new(&data.camera, grid, offset_px);
        let matcher = Matcher::new(camera, DepthNoise::default(), &method.registration);
        Self { method, grid, surfaces, shutter, queries, matcher }
    }
}

fn samples(method: &Method, grid: Grid, vertices: &[Vertex]) -> Vec<Sample> {
    let mut samples = Vec::new();
    Sampler::default().draw(&SurfaceView { grid, vertices }, 1, &method.registration, &mut samples);
    samples
}

/// A keyframe's surface into the bytes of the store.
#[divan::bench]
fn pack_surface(bencher: Bencher<'_, '_>) {
    let pair = PairOfFrames::new();
    let beside = beside(pair.grid);
    bencher.bench_local(|| packed::pack(pair.grid, &pair.surfaces[0], &beside));
}

/// The bytes of the store into a keyframe's surface.
#[divan::bench]
fn unpack_surface(bencher: Bencher<'_, '_>) {
    let pair = PairOfFrames::new();
    let beside = beside(pair.grid);
    let bytes = packed::pack(pair.grid, &pair.surfaces[0], &beside);
    bencher.bench_local(|| packed::unpack(pair.grid, &bytes, &beside));
}

/// Of these bytes the vertices that travel in a fleet.
#[divan::bench]
fn unpack_first_vertices(bencher: Bencher<'_, '_>) {
    let pair = PairOfFrames::new();
    let beside = beside(pair.grid);
    let bytes = packed::pack(pair.grid, &pair.surfaces[0], &beside);
    bencher.bench_local(|| packed::unpack_first(pair.grid, &bytes, &beside));
}

/// As many places as a keyframe has under features.
fn beside(grid: Grid) -> Vec<usize> {
    (0..grid.len()).step_by(61).collect()
}

/// Samples by place and by direction of the normal.
#[divan::bench]
fn sampling(bencher: Bencher<'_, '_>) {
    let pair = PairOfFrames::new();
    let (mut sampler, mut samples) = (Sampler::default(), Vec::new());
    let view = SurfaceView { grid: pair.grid, vertices: &pair.surfaces[1] };
    bencher.bench_local(|| sampler.draw(&view, 1, &pair.method.registration, &mut samples));
}

/// Search, rejection and sums of one pair of frames: all that an outer iteration does for it.
#[divan::bench(args = [400, 2000])]
fn search_and_accumulate(bencher: Bencher<'_, '_>, count: usize) {
    let PairOfFrames { grid, surfaces, shutter, queries, mut matcher, .. } = PairOfFrames::new();
    let surface = SurfaceView { grid, vertices: &surfaces[0] };
    let target = Target { surface, shutter: &shutter, tree: None };
    let (selection, limits) = (Selection { count, shift: 0 }, MatchLimits::new(0.1, 0.5));
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| matcher.match_pair(&queries, selection, &target, &Pose::identity(), &limits));
}

/// The same by the exact nearest vertex; building its tree is `tree`.
#[divan::bench(args = [400, 2000])]
fn search_exact_and_accumulate(bencher: Bencher<'_, '_>, count: usize) {
    let PairOfFrames { grid, surfaces, shutter, queries, mut matcher, .. } = PairOfFrames::new();
    let surface = SurfaceView { grid, vertices: &surfaces[0] };
    let tree = KdTree::new(&surface, &shutter);
    let target = Target { surface, shutter: &shutter, tree: Some(&tree) };
    let (selection, limits) = (Selection { count, shift: 0 }, MatchLimits::new(0.1, 0.5));
    bencher
        .counter(ItemsCount::new(count))
        .bench_local(|| matcher.match_pair(&queries, selection, &target, &Pose::identity(), &limits));
}

#[divan::bench]
fn tree(bencher: Bencher<'_, '_>) {
    let pair = PairOfFrames::new();
    let surface = SurfaceView { grid: pair.grid, vertices: &pair.surfaces[0] };
    bencher.bench_local(|| KdTree::new(&surface, &pair.shutter));
}

/// An inner iteration's share of one pair: nothing per point.
#[divan::bench]
fn linearise(bencher: Bencher<'_, '_>) {
    let PairOfFrames { grid, surfaces, shutter, queries, mut matcher, .. } = PairOfFrames::new();
    let surface = SurfaceView { grid, vertices: &surfaces[0] };
    let target = Target { surface, shutter: &shutter, tree: None };
    let selection = Selection { count: 2000, shift: 0 };
    let limits = MatchLimits::new(0.1, 0.5);
    let (sums, _) = matcher.match_pair(&queries, selection, &target, &Pose::identity(), &limits);
    let block = PairBlock::new(&Pose::identity(), &sums.all());
    let moved = exp(&Twist { rho: [0.01, 0.0, 0.0].into(), phi: [0.0, 0.01, 0.0].into() });
    bencher.bench_local(|| block.linearise(divan::black_box(&moved)));
}

/// A window of five fixed poses and one free: the aligner's system.
#[divan::bench]
fn solve_window(bencher: Bencher<'_, '_>) {
    let graph = pose_graph::window(5);
    bencher.with_inputs(|| graph.clone()).bench_local_values(|mut graph| {
        graph.optimise(10, &mut || ()).expect("solvable");
        graph
    });
}

/// 200 poses and 332 edges from a drifted start to convergence.
#[divan::bench]
fn pose_graph_200_nodes_332_edges(bencher: Bencher<'_, '_>) {
    let graph = pose_graph::ring(200, 332);
    bencher.with_inputs(|| graph.clone()).bench_local_values(|mut graph| {
        let report = graph.optimise(50, &mut || ()).expect("solvable");
        assert!(report.is_converged);
        graph
    });
}
