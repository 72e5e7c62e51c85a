//! A run directory that grows by hand, as stages write it.

use std::path::{Path, PathBuf};
use std::time::Duration;
use tessera_fleet::chaos::difference;
use tessera_geometry::{Camera, Pose, PoseBits};
use tessera_journal::{Journal, Store};
use tessera_messages::store_surface;
use tessera_numerics::SplitMix64;
use tessera_settings::Settings;
use tessera_slam::{
    AlignRecord, Cause, Correction, FrameRecord, KeyframeRecord, MapChange, OptimiseRecord, PairChanges,
    PoseRecord, RetiredRecord,
};
use tessera_stage::{ALIGN_JOURNAL, BaseAnswer, OPTIMISE_JOURNAL, RunFile, RunFiles, store_slot};
use tessera_surface::{Grid, Vertex};
use tessera_transport::RunIdentity;

/// Frames from one keyframe to the next.
const KEYFRAME_EVERY: u64 = 7;

pub(crate) struct GrowingRun {
    pub(crate) files: RunFiles,
    align: Journal<AlignRecord>,
    optimise: Journal<OptimiseRecord>,
    store: Store,
    random: SplitMix64,
    n_frames: u64,
    n_keyframes: u32,
    /// Keyframes that the next one culls.
    pub(crate) culls: Vec<u32>,
}

/// A camera whose surfaces have sixteen vertices.
fn camera() -> Camera {
    Camera::pinhole((16, 16), [14.0, 14.0, 7.5, 7.5], 1000.0)
}

/// Writes what every run directory begins with.
pub(crate) fn begin(folder: &Path, name: &str, camera: &Camera) -> RunFiles {
    std::fs::create_dir_all(folder).unwrap();
    let files = RunFiles::new(folder);
    let settings = Settings::from_toml("", "none").unwrap();
    std::fs::write(files.config(), settings.to_toml().unwrap()).unwrap();
    let identity = RunIdentity {
        root: PathBuf::from("/nowhere"),
        prefix: name.chars().take(8).collect(),
        config_file: PathBuf::from("/nowhere/config.toml"),
    };
    let run = RunFile {
        name: name.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        identity,
        camera: camera.clone(),
        stamp_sigma_s: 0.0,
        n_frames: None,
        fps: None,
        doubts: Vec::new(),
        warnings: Vec::new(),
        map: None,
        map_cameras: Vec::new(),
        faults: false,
        began_as: None,
    };
    run.write(&files).unwrap();
    files
}

impl GrowingRun {
    pub(crate) fn begin(folder: &Path, name: &str, seed: u64) -> Self {
        let files = begin(folder, name, &camera());
        let open = |_| Ok(());
        let (align, _) = Journal::open(&files.align_journal(), ALIGN_JOURNAL, Duration::ZERO, open).unwrap();
        let (optimise, _) =
            Journal::open(&files.optimise_journal(), OPTIMISE_JOURNAL, Duration::ZERO, |_| Ok(())).unwrap();
        let store = Store::open(&files.store(), Duration::ZERO).unwrap();
        let random = SplitMix64::for_frame(seed, 0);
        Self { files, align, optimise, store, random, n_frames: 0, n_keyframes: 0, culls: Vec::new() }
    }

    /// One frame more, with a keyframe now and then.
    pub(crate) fn grow(&mut self) {
        let index = self.n_frames;
        let pose = PoseBits::from(&Pose::translation(index as f64 * 0.01, 0.0, 0.0));
        let new_keyframe = index.is_multiple_of(KEYFRAME_EVERY).then(|| self.keyframe(index, pose));
        let keyframe = self.n_keyframes.saturating_sub(1);
        let record = FrameRecord {
            index,
            stamp_nanos: index as i64 * 33_000_000,
            causes: vec![self.words()],
            pose: PoseRecord {
                world_from_camera: pose,
                keyframe,
                entropy_nats: 0.0,
                ..PoseRecord::default()
            },
            change: MapChange { new_keyframe, ..MapChange::default() },
            ..FrameRecord::default()
        };
        self.align.append(&AlignRecord::Frame(Box::new(record)), false).unwrap();
        if index % 5 == 4 {
            let correction = OptimiseRecord::Correction(Box::new(answer_of(0, index).correction));
            self.optimise.append(&correction, false).unwrap();
        }
        self.n_frames += 1;
    }

    /// Words of any length, which can be packed a little and no more.
    fn words(&mut self) -> Cause {
        let n = self.random.below(10_000);
        let words = (0..n).map(|_| char::from(b'a' + self.random.below(26) as u8)).collect();
        Cause::Recorded {
            words,
            is_degenerate: false,
            is_relocalisation_asked: false,
            has_too_few_points: false,
        }
    }

    fn keyframe(&mut self, index: u64, pose: PoseBits) -> KeyframeRecord {
        let vertex = |z: f32| Vertex {
            position: [0.0, 0.0, z],
            flags_rgb: Vertex::pack(Vertex::VALID, 0, [9; 3]),
            normal: [0.0, 0.0, -1.0],
            reserved: 0,
        };
        let surface: Vec<Vertex> =
            (0..16).map(|_| vertex(1.0 + self.random.below(1000) as f32 / 500.0)).collect();
        let grid = Grid { width: 4, height: 4, step: 4 };
        // Of a number of bytes of its own, as its depths are random.
        let (bytes, _) = store_surface(grid, &surface);
        let slot = store_slot(&self.store.append(&bytes, false).unwrap());
        self.n_keyframes += 1;
        let (id, frame) = (self.n_keyframes - 1, (index, index as i64 * 33_000_000));
        let retires = std::mem::take(&mut self.culls).into_iter().map(retired).collect();
        KeyframeRecord { slot, retires, ..KeyframeRecord::new(id, frame, pose, Vec::new()) }
    }

    /// The source is exhausted, and there is nothing to be optimised.
    pub(crate) fn end(&mut self) {
        self.end_journals();
        self.say_how_it_ended("finished");
    }

    /// As far as the aligner ends it.
    pub(crate) fn end_journals(&mut self) {
        let end = AlignRecord::End { n_frames: self.n_frames, request: None };
        self.align.append(&end, true).unwrap();
    }

    /// What the supervisor says while the run goes on, and last.
    pub(crate) fn say_how_it_ended(&self, ended: &str) {
        let statistics = format!("{{\"ended\": \"{ended}\"}}");
        std::fs::write(self.files.dir.join("statistics.json"), statistics).unwrap();
    }
}

/// A keyframe that is culled, anchored to the first one.
fn retired(keyframe: u32) -> RetiredRecord {
    RetiredRecord { keyframe, anchored_to: 0 }
}

/// An answer that corrects nothing, from no keyframes that a run has.
pub(crate) fn answer_of(identity: u64, request: u64) -> BaseAnswer {
    let correction = Correction { request, input_hash: request, ..Correction::default() };
    BaseAnswer { identity, correction, changes: PairChanges::default() }
}

/// Asserts that a copy is the run, byte for byte; of the store up to the last surface.
pub(crate) fn assert_same(original: &Path, copy: &Path) {
    assert_eq!(difference(original, copy).unwrap(), None);
}
