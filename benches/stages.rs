//! Whole stages in one process: `cargo bench --bench stages`.

mod common;
#[path = "common/keyframes.rs"]
mod keyframes;

use common::frames;
use divan::Bencher;
use divan::counter::ItemsCount;
use tessera_offline::{Method, RawFrame, Run};
use tessera_slam::{OptimiseRecord, Optimiser, RequestRecord};
use tessera_surface::{Reconstructor, SurfaceSettings, Vertex};

fn main() {
    divan::main();
}

/// A frame's whole reconstruction, for each step `n`; one ring of the filter.
#[divan::bench(args = [1, 2, 4, 8])]
fn reconstruct(bencher: Bencher<'_, '_>, step: u32) {
    let data = frames();
    let settings = SurfaceSettings { step, ..SurfaceSettings::default() };
    let mut reconstructor = Reconstructor::new(&data.camera, &settings).expect("good settings");
    let mut out = vec![Vertex::default(); reconstructor.grid().len()];
    let mut next = data.frames.iter().cycle();
    bencher.bench_local(move || {
        let RawFrame { depth, colour, .. } = next.next().expect("a cycle has no end");
        reconstructor.reconstruct(depth, colour.as_deref(), &mut out)
    });
}

/// Reconstruction, alignment, keyframes and corrections, as in `tessera run`, without its end.
#[divan::bench(sample_count = 5, sample_size = 1)]
fn all_stages_of_60_frames(bencher: Bencher<'_, '_>) {
    let data = frames();
    bencher.counter(ItemsCount::new(data.frames.len())).bench_local(|| {
        let mut run = Run::new(&data.camera, &Method::default()).expect("good settings");
        data.frames.iter().for_each(|frame| drop(run.push(frame)));
        run.stop()
    });
}

/// All multi-edges of 200 keyframes: one outer iteration with what comes before it, all threads.
#[divan::bench(sample_count = 10, sample_size = 1)]
fn global_optimisation_of_200_keyframes(bencher: Bencher<'_, '_>) {
    global_optimisation(bencher, 200);
}

/// As above for 2,000 keyframes; seven rounds through the house.
#[divan::bench(sample_count = 2, sample_size = 1, ignore)]
fn global_optimisation_of_2000_keyframes(bencher: Bencher<'_, '_>) {
    global_optimisation(bencher, 2000);
}

/// As above for 20,000 keyframes; 67 rounds through the house.
#[divan::bench(sample_count = 1, sample_size = 1, ignore)]
fn global_optimisation_of_20000_keyframes(bencher: Bencher<'_, '_>) {
    global_optimisation(bencher, 20_000);
}

fn global_optimisation(bencher: Bencher<'_, '_>, n: u64) {
    let map = keyframes::map(n);
    let (optimiser, request) = map.optimiser();
    bencher.bench_local(|| solve(&map, &optimiser, &request));
}

/// The correction after one new loop: 2,000 keyframes were corrected before by the same optimiser, and three new ones
/// come back to a place that the map has. Each sample has an optimiser of its own.
#[divan::bench(sample_count = 7, sample_size = 1, ignore)]
fn new_loop_among_2000_keyframes(bencher: Bencher<'_, '_>) {
    let map = keyframes::map(2003);
    bencher.with_inputs(|| map.corrected_optimiser(3)).bench_local_values(|(optimiser, request)| {
        let began = cpu_ms();
        let solved = solve(&map, &optimiser, &request);
        eprintln!("CPU {:.1} ms", cpu_ms() - began);
        solved
    });
}

fn solve(map: &keyframes::Map, optimiser: &Optimiser, request: &RequestRecord) -> OptimiseRecord {
    optimiser.solve(request, &map.surfaces, &[].as_slice(), &mut || ()).expect("pending")
}

/// CPU time of all threads, milliseconds.
fn cpu_ms() -> f64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    now.tv_sec as f64 * 1e3 + now.tv_nsec as f64 * 1e-6
}
