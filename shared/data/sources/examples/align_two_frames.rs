//! Two depth images become the motion of the camera between them, with its certainty.
//!
//! `cargo run --release -p tessera-sources --example align_two_frames`
#![forbid(unsafe_code)]

use std::error::Error;
use tessera_geometry::{DepthNoise, Pose, Twist, translation_rotation_norms};
use tessera_graph::{Graph, INNER_ITERATIONS, Pair, PairBlock};
use tessera_registration::{
    GridCamera, MatchLimits, Matcher, Queries, RegistrationSettings, Sampler, Selection, ShutterTable, Target,
};
use tessera_sources::{FrameBuffers, SceneName, SimulatedSource, SimulationOptions, Source};
use tessera_surface::{Reconstructor, SurfaceSettings, SurfaceView, Vertex};

/// Outer iterations: each searches for matches anew.
const ITERATIONS: u32 = 10;
/// Matches farther apart are not looked for in the first iteration, metres.
const FIRST_DISTANCE_M: f64 = 0.3;

/// The frame that is aligned to frame 0. Farther on a start from nothing slides along the wall: the
/// tracker begins from a prediction, and tests its answer.
const FRAME: u64 = 2;

fn main() -> Result<(), Box<dyn Error>> {
    let source = SimulatedSource::open(SceneName::Room, None, Some(10), &SimulationOptions::default())?;
    let camera = source.camera();
    let mut reconstructor = Reconstructor::new(camera, &SurfaceSettings::default())?;
    let (target, query) =
        (surface(&source, 0, &mut reconstructor)?, surface(&source, FRAME, &mut reconstructor)?);
    let grid = reconstructor.grid();

    // A vertex is the mean of its cell: it lies in the middle of the cell's pixels.
    let offset_px = (grid.step as f64 - 1.0) / 2.0;
    // Without a rolling shutter the motion during the readout does not matter.
    let shutter = ShutterTable::new(camera, &Twist::default(), grid.height, grid.step, offset_px);
    let settings = RegistrationSettings::default();
    let mut samples = Vec::new();
    Sampler::default().draw(&SurfaceView { grid, vertices: &query }, FRAME, &settings, &mut samples);
    let mut queries = Queries::default();
    queries.fill(&samples, &shutter);
    let fixed = Target { surface: SurfaceView { grid, vertices: &target }, shutter: &shutter, tree: None };
    let mut matcher =
        Matcher::new(GridCamera::new(camera, grid, offset_px), DepthNoise::default(), &settings);

    let mut target_from_query = Pose::identity();
    for k in 0..ITERATIONS {
        let limits = MatchLimits::new(FIRST_DISTANCE_M, k as f32 / (ITERATIONS - 1) as f32);
        let selection = Selection { count: samples.len(), shift: 0 };
        let (sums, report) = matcher.match_pair(&queries, selection, &fixed, &target_from_query, &limits);
        let block = PairBlock::new(&target_from_query, &sums.all());
        let mut graph = Graph {
            poses: vec![Pose::identity(), target_from_query],
            is_fixed: vec![true, false],
            pairs: vec![Pair::new(1, 0, block)],
            isa: settings.isa,
            ..Graph::default()
        };
        graph.optimise(INNER_ITERATIONS, &mut || ())?;
        target_from_query = graph.poses[1];
        println!(
            "{} of {} queries matched, median residual {:.2} standard deviations",
            report.n_matches, report.n_queries, report.median_residual_sigmas
        );
    }

    let truth = source.ground_truth().ok_or("a scene knows its camera's path")?;
    let true_motion = truth.poses[0].inverse() * truth.poses[FRAME as usize];
    let (moved_m, turned_rad) = translation_rotation_norms(&target_from_query);
    let (off_m, off_rad) = translation_rotation_norms(&(true_motion.inverse() * target_from_query));
    println!("the camera moved by {:.1} mm and {:.2} degrees", 1e3 * moved_m, turned_rad.to_degrees());
    println!("off the truth by {:.1} mm and {:.2} degrees", 1e3 * off_m, off_rad.to_degrees());
    Ok(())
}

fn surface(
    source: &dyn Source,
    index: u64,
    reconstructor: &mut Reconstructor,
) -> Result<Vec<Vertex>, Box<dyn Error>> {
    let n_pixels = source.camera().width as usize * source.camera().height as usize;
    let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
    source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour })?;
    let mut vertices = vec![Vertex::default(); reconstructor.grid().len()];
    reconstructor.reconstruct(&depth, Some(&colour), &mut vertices);
    Ok(vertices)
}
