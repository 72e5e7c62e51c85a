//! What the journal and the keyframe store cost a frame, beside the method itself.
//!
//! `cargo run --release -p tessera-offline --example journal_cost -- SEQUENCE... [--dir DIR]`
//!
//! Tracks each sequence once in memory, then writes the very records and surfaces that came of it
//! down again and again, as `align` does, under each policy of `flow.fsync`. DIR names the disk.
#![forbid(unsafe_code)]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use tessera_journal::{Journal, RecordKind, Store};
use tessera_offline::{Method, RawFrame, Run};
use tessera_settings::Settings;
use tessera_slam::AlignRecord;
use tessera_sources::{SourceOptions, SourceSpec};
use tessera_surface::Vertex;

/// Records as in a run's journal.
const KIND: RecordKind<AlignRecord> = RecordKind::only("align", 1);
/// Repetitions of each policy; the median counts.
const REPEAT: usize = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let mut sequences = Vec::new();
    let mut dir = std::env::temp_dir();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--dir" => dir = PathBuf::from(arguments.next().ok_or("--dir DIR")?),
            _ => sequences.push(argument),
        }
    }
    for sequence in &sequences {
        measure(sequence, &dir)?;
    }
    Ok(())
}

fn measure(sequence: &str, dir: &Path) -> Result<(), Box<dyn Error>> {
    let settings = Settings::load(None, &[])?;
    let method =
        Method { surface: settings.surface, registration: settings.registration, mapping: settings.mapping };
    let source = tessera_sources::open(&SourceSpec::parse(sequence), &SourceOptions::default())?;
    let n_frames = source.n_frames().unwrap_or(0);
    let mut run = Run::new(source.camera(), &method)?;
    let mut without_ms = 0.0;
    for index in 0..n_frames {
        let frame = RawFrame::read(&*source, index)?;
        let started = cpu_ms();
        run.push(&frame);
        without_ms += cpu_ms() - started;
    }
    let started = cpu_ms();
    let (records, map) = run.finish_with_map();
    without_ms += cpu_ms() - started;
    let frames = n_frames as f64;
    println!("{sequence}: {n_frames} frames, {} keyframes", records.n_keyframes());
    println!("  without        {:8.3} ms CPU a frame", without_ms / frames);
    for policy in ["never", "keyframe", "always"] {
        let mut costs: Vec<Cost> = (0..REPEAT)
            .map(|_| write_down(&records.records, &map.surfaces, policy, dir))
            .collect::<Result<_, _>>()?;
        costs.sort_by(|a, b| a.cpu_ms.total_cmp(&b.cpu_ms));
        let cost = &costs[REPEAT / 2];
        println!(
            "  fsync {policy:8} {:8.3} ms CPU a frame, {:.1} % of that; {:.3} ms on the clock, {:.2} for a keyframe",
            cost.cpu_ms / frames,
            100.0 * cost.cpu_ms / without_ms,
            cost.wall_ms / frames,
            cost.keyframe_ms,
        );
    }
    Ok(())
}

/// Of all records together.
struct Cost {
    cpu_ms: f64,
    wall_ms: f64,
    /// Median of those records that carry a surface.
    keyframe_ms: f64,
}

fn write_down(
    records: &[AlignRecord],
    surfaces: &[Vec<Vertex>],
    policy: &str,
    dir: &Path,
) -> Result<Cost, Box<dyn Error>> {
    let folder = tempfile::tempdir_in(dir)?;
    let (mut journal, _) = Journal::open(&folder.path().join("journal"), KIND, Duration::ZERO, |_| Ok(()))?;
    let mut store = Store::open(&folder.path().join("store"), Duration::ZERO)?;
    let mut keyframes_ms = Vec::new();
    let (cpu, wall) = (cpu_ms(), Instant::now());
    for record in records {
        let started = Instant::now();
        let keyframe = match record {
            AlignRecord::Frame(frame) => frame.change.new_keyframe.as_ref(),
            _ => None,
        };
        if let Some(surface) = keyframe.and_then(|k| surfaces.get(k.id as usize)) {
            store.append(bytemuck::cast_slice(surface), policy != "never")?;
        }
        let is_plain = matches!(record, AlignRecord::Frame(_)) && keyframe.is_none();
        journal.append(record, policy == "always" || policy == "keyframe" && !is_plain)?;
        if keyframe.is_some() {
            keyframes_ms.push(started.elapsed().as_secs_f64() * 1e3);
        }
    }
    let (cpu_ms, wall_ms) = (cpu_ms() - cpu, wall.elapsed().as_secs_f64() * 1e3);
    keyframes_ms.sort_by(f64::total_cmp);
    let keyframe_ms = keyframes_ms.get(keyframes_ms.len() / 2).copied().unwrap_or(f64::NAN);
    Ok(Cost { cpu_ms, wall_ms, keyframe_ms })
}

/// CPU time of this process so far: unlike the wall clock it does not see the machine's load.
fn cpu_ms() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
}
