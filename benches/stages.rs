//! Whole stages in one process: `cargo bench --bench stages`.

mod common;
#[path = "common/keyframes.rs"]
mod keyframes;

use common::frames;
use divan::Bencher;
use divan::counter::ItemsCount;
use tessera_offline::{Method, RawFrame, Run};
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
    let (optimiser, request, surfaces) = keyframes::optimiser(200);
    bencher
        .bench_local(|| optimiser.solve(&request, &surfaces, &[].as_slice(), &mut || ()).expect("pending"));
}

/// As above for 2,000 keyframes; seven rounds through the house.
#[divan::bench(sample_count = 2, sample_size = 1, ignore)]
fn global_optimisation_of_2000_keyframes(bencher: Bencher<'_, '_>) {
    let (optimiser, request, surfaces) = keyframes::optimiser(2000);
    bencher
        .bench_local(|| optimiser.solve(&request, &surfaces, &[].as_slice(), &mut || ()).expect("pending"));
}

/// As above for 20,000 keyframes; 67 rounds through the house.
#[divan::bench(sample_count = 1, sample_size = 1, ignore)]
fn global_optimisation_of_20000_keyframes(bencher: Bencher<'_, '_>) {
    let (optimiser, request, surfaces) = keyframes::optimiser(20_000);
    bencher
        .bench_local(|| optimiser.solve(&request, &surfaces, &[].as_slice(), &mut || ()).expect("pending"));
}
