//! What grows with a run, and what does not: counted in work and bytes, not in time.

use crate::common::{room, signal};
use rayon::prelude::*;
use tessera_offline::{Method, RawFrame, Run};
use tessera_slam::FrameRecord;
use tessera_sources::{FrameBuffers, SceneName, SimulatedSource, SimulationOptions, Source};

/// Frames of one round through the simulated room.
const ROUND: usize = 360;
const ROUNDS: usize = 4;

/// One round through the room, seen by the small camera of the other tests.
fn round(camera: &str) -> (SimulatedSource, Vec<RawFrame>) {
    let options = SimulationOptions::default();
    let source = SimulatedSource::open(SceneName::Room, Some(camera), None, &options).unwrap();
    let n_pixels = (source.camera().width * source.camera().height) as usize;
    let frames = (0..ROUND as u64)
        .into_par_iter()
        .map(|index| {
            let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
            let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
            let info = source.read(index, &mut buffers).unwrap();
            RawFrame { stamp_nanos: info.stamp_nanos, depth, colour: Some(colour), rotation: None, up: None }
        })
        .collect();
    (source, frames)
}

/// What is counted of a frame.
type Count = fn(&FrameRecord) -> usize;

/// Mean over frames.
fn mean(frames: &[&FrameRecord], of: impl Fn(&FrameRecord) -> usize) -> f64 {
    frames.iter().map(|frame| of(frame) as f64).sum::<f64>() / frames.len() as f64
}

#[test]
fn the_work_of_a_frame_is_the_same_early_and_late() {
    let dir = tempfile::tempdir().unwrap();
    let camera = dir.path().join("camera.toml");
    crate::common::write_camera(&camera);
    let (source, frames) = round(&camera.display().to_string());
    let mut method = Method::default();
    method.surface.step = 2;
    let mut run = Run::new(source.camera(), &method).unwrap();
    for k in 0..ROUND * ROUNDS {
        let stamp_nanos = k as i64 * 33_333_333;
        run.push(&RawFrame { stamp_nanos, ..frames[k % ROUND].clone() });
    }
    let records = run.stop();
    let all: Vec<&FrameRecord> = records.frames().collect();
    // The first round makes the map; in the second and the last one the same frames are aligned to it.
    let (early, late) = (&all[ROUND..2 * ROUND], &all[(ROUNDS - 1) * ROUND..]);
    let counts: [(&str, Count); 2] = [
        ("pairs", |frame| frame.evidence.blocks.len()),
        ("matches", |frame| frame.pose.n_correspondences as usize),
    ];
    for (what, of) in counts {
        let (early, late) = (mean(early, of), mean(late, of));
        // The budget of correspondences bounds it; a map that is known better matches a little more.
        assert!(early > 0.0 && late < 1.25 * early, "{what}: {early} a frame early, {late} late");
    }
    let n_keyframes =
        |frames: &[&FrameRecord]| frames.iter().filter(|f| f.change.new_keyframe.is_some()).count();
    let (first, last) = (n_keyframes(&all[..ROUND]), n_keyframes(late));
    // The same way asks for the same keyframes again, and not for more.
    assert!(last <= first + first / 10, "{first} keyframes in the first round, {last} in the last");
}

/// Bytes of a run's journals and store.
fn on_disk(out: &std::path::Path) -> u64 {
    ["align.journal", "optimise.journal", "keyframes.store"]
        .map(|name| std::fs::metadata(out.join(name)).map_or(0, |meta| meta.len()))
        .iter()
        .sum()
}

/// Memory of a process that is no mapped file, bytes.
fn anonymous(pid: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).unwrap();
    let line = status.lines().find(|line| line.starts_with("RssAnon:")).unwrap();
    line.split_whitespace().nth(1).unwrap().parse::<u64>().unwrap() * 1024
}

/// Vertices of the small camera.
const N_VERTICES: u64 = 80 * 60;

/// Of a run that came to a frame and on for a while: keyframes, bytes of journals and store, and
/// memory of the aligner and the optimiser at that frame.
fn at_frame(frame: u64) -> (u64, u64, u64) {
    let plan = format!("align=computed:{frame}:stop");
    let run = room().frames(frame + 40).with_faults(&plan);
    let mut child = run.start();
    let align = run.wait_until_stopped("align");
    let optimise = run.stage_pid("optimise");
    let memory = anonymous(align) + anonymous(optimise);
    signal(align, "CONT");
    assert!(child.wait().unwrap().success(), "{}", run.log());
    let summary: serde_json::Value = serde_json::from_slice(&run.output("summary.json")).unwrap();
    (summary["keyframes"].as_u64().unwrap(), on_disk(&run.out()), memory)
}

#[test]
fn a_keyframe_costs_little_memory_and_disk() {
    let (n_early, disk_early, memory_early) = at_frame(60);
    let (n_late, disk_late, memory_late) = at_frame(300);
    let n = n_late - n_early;
    assert!(n >= 15, "{n_early} keyframes early, {n_late} late");
    let (disk, memory) = ((disk_late - disk_early) / n, memory_late.saturating_sub(memory_early) / n);
    // Eight bytes a vertex, 400 features, and the records of the frames between two keyframes.
    assert!(disk <= 8 * N_VERTICES + 56 * 400 + 50_000, "{disk} bytes on disk for each keyframe");
    // Both processes hold it unpacked, up to 64 of them, with what they derive from it.
    assert!(memory <= 2 * 32 * N_VERTICES + 100_000, "{memory} bytes of memory for each keyframe");
}

/// The short form of `scripts/day.py`: 72 s of simulated time, six rounds through the room.
#[test]
fn a_day_takes_no_more_memory_than_its_first_third() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut script = std::process::Command::new("python3");
    script.arg(root.join("scripts/day.py")).args(["--hours", "0.02", "--budget", "60"]);
    let output = match script.env("TESSERA", env!("CARGO_BIN_EXE_tessera")).output() {
        Ok(output) => output,
        Err(error) => return crate::requirements::missing("python", error),
    };
    let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap()).concat();
    assert!(output.status.success(), "{text}");
    assert!(text.contains("2160 of 2160 frames, 0.02 h of simulated time, 0 not tracked"), "{text}");
    assert_eq!(text.matches("MB in the first third").count(), 4, "{text}");
}
