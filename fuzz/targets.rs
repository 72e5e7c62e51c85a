//! What is fuzzed: every reader of bytes from outside. A target panics where a promise is broken:
//! input that is refused has an error in words, input that is taken keeps the rules of its kind.

use serde::{Deserialize, Deserializer, Serialize, Serializer, ser::SerializeTuple};
use std::path::Path;
use std::time::Duration;
use tessera_evaluation::parse_tum;
use tessera_journal::{Follower, Journal, RecordKind};
use tessera_messages::{
    Beat, CameraFrame, Flow, FrameHeader, FrameShape, PoseMessage, SurfaceExpectation, SurfaceHeader,
};
use tessera_settings::Settings;
use tessera_slam::TrackerState;
use tessera_sources::{
    FolderSource, FrameBuffers, RecordingOptions, RecordingSource, Source, SourceOptions, SourceSpec,
    load_camera,
};
use tessera_stage::{ALIGN_JOURNAL, OPTIMISE_JOURNAL};
use tessera_surface::packed::unpack_spread;
use tessera_surface::{Grid, Vertex};

/// Takes any bytes, and panics where a promise is broken.
pub type FuzzTarget = fn(&[u8]);

/// All targets by the names of their corpora.
pub const TARGETS: [(&str, FuzzTarget); 7] = [
    ("lists", lists),
    ("camera", camera),
    ("configuration", configuration),
    ("images", images),
    ("journal", journal),
    ("messages", messages),
    ("recording", recording),
];

const CAMERA: &str =
    "width = 16\nheight = 16\nfx = 16.0\nfy = 16.0\ncx = 7.5\ncy = 7.5\nunits_per_metre = 5000.0\n";
const N_PIXELS: usize = 16 * 16;

thread_local! {
    static FOLDER: tempfile::TempDir = tempfile::tempdir().expect("a folder for the input");
}

fn in_folder(work: impl FnOnce(&Path)) {
    FOLDER.with(|folder| work(folder.path()));
}

fn write(folder: &Path, name: &str, bytes: &[u8]) {
    std::fs::write(folder.join(name), bytes).expect("the input can be written");
}

/// The lists of a folder in the TUM layout, and trajectories.
pub fn lists(bytes: &[u8]) {
    in_folder(|folder| {
        write(folder, "camera.toml", CAMERA.as_bytes());
        write(folder, "depth.txt", bytes);
        write(folder, "rgb.txt", bytes);
        match FolderSource::open(folder, None, None) {
            Ok(source) => {
                let n = source.n_frames().expect("a folder has an end");
                let stamps: Vec<_> =
                    (0..n).map(|index| source.stamp_nanos(index).expect("in range")).collect();
                assert!(stamps.is_sorted_by(|a, b| a < b), "stamps do not rise");
                assert!(source.stamp_nanos(n).is_none());
            }
            Err(error) => assert!(error.to_string().contains(".txt"), "{error}"),
        }
    });
    let text = String::from_utf8_lossy(bytes);
    match parse_tum(&text, Path::new("trajectory.txt")) {
        Ok(trajectory) => {
            assert!(trajectory.stamps_nanos.is_sorted_by(|a, b| a < b), "stamps do not rise");
            assert!(trajectory.poses.iter().all(|p| p.translation.vector.iter().all(|v| v.is_finite())));
        }
        Err(error) => assert!(error.to_string().contains("trajectory.txt"), "{error}"),
    }
}

/// The times and the first frames of a source that was opened; errors name its file.
fn read_all(source: &dyn Source, name: &str) {
    source.camera().check().expect("a camera that was taken holds its rules");
    let n = source.n_frames().expect("a file has an end");
    let stamps: Vec<_> = (0..n).map(|index| source.stamp_nanos(index).expect("in range")).collect();
    assert!(stamps.is_sorted_by(|a, b| a < b), "stamps do not rise");
    let n_pixels = (source.camera().width * source.camera().height) as usize;
    let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
    for index in 0..n.min(4) {
        let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
        if let Err(error) = source.read(index, &mut buffers) {
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}

/// MCAP files, bags of ROS 1 and bags of ROS 2 in SQLite.
pub fn recording(bytes: &[u8]) {
    in_folder(|folder| {
        write(folder, "my.mcap", bytes);
        write(folder, "mcap-camera.toml", CAMERA.as_bytes());
        let given = folder.join("mcap-camera.toml").display().to_string();
        for camera in [None, Some(given.as_str())] {
            let options = RecordingOptions { camera, ..RecordingOptions::default() };
            match RecordingSource::open(&folder.join("my.mcap"), &options, None) {
                Ok(source) => read_all(&source, "my.mcap"),
                Err(error) => assert!(error.to_string().contains("my.mcap"), "{error}"),
            }
        }
    });
}

/// Camera files.
pub fn camera(bytes: &[u8]) {
    in_folder(|folder| {
        write(folder, "my-camera.toml", bytes);
        match load_camera(&folder.join("my-camera.toml")) {
            Ok(camera) => camera.check().expect("a camera that was taken holds its rules"),
            Err(error) => assert!(error.to_string().contains("my-camera.toml"), "{error}"),
        }
    });
}

/// Configuration files, and the arguments of `--set`.
pub fn configuration(bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let given = Settings::load(None, &[text.to_string()]);
    for result in [Settings::from_toml(&text, "my.toml"), given] {
        match result {
            Ok(settings) => {
                settings.check().expect("settings that were taken hold their rules");
                let again = Settings::from_toml(&settings.to_toml().expect("can be written"), "again");
                assert!(again.is_ok_and(|again| again == settings), "settings do not survive a file");
            }
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
}

/// Depth, colour and confidence images; the first byte says which one is not what it should be.
pub fn images(bytes: &[u8]) {
    let Some((which, bytes)) = bytes.split_first() else { return };
    in_folder(|folder| match which {
        2..=4 => record3d(folder, *which, bytes),
        5 => named(folder, "my.sens", bytes),
        7 => named(folder, "my.r3d", bytes),
        _ => tum_images(folder, which % 2 == 0, bytes),
    });
}

fn tum_images(folder: &Path, is_depth: bool, bytes: &[u8]) {
    write(folder, "camera.toml", CAMERA.as_bytes());
    write(folder, "depth.txt", b"1.0 depth.png\n");
    write(folder, "rgb.txt", b"1.0 rgb\n");
    write(folder, "depth.png", DEPTH);
    write(folder, if is_depth { "depth.png" } else { "rgb" }, bytes);
    let source = FolderSource::open(folder, None, None).expect("the lists are good");
    let (mut depth, mut colour) = (vec![0; N_PIXELS], vec![0; 3 * N_PIXELS]);
    let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
    if let Err(error) = source.read(0, &mut buffers) {
        assert!(error.to_string().contains("frame 0"), "{error}");
    }
}

/// A folder of Record3D: its depth (2), confidence (3) or metadata (4).
fn record3d(folder: &Path, which: u8, bytes: &[u8]) {
    let folder = folder.join("record3d");
    std::fs::create_dir_all(folder.join("rgbd")).expect("a folder for the input");
    write(&folder, "rgbd/0.depth", if which == 2 { bytes } else { &LZFSE_DEPTH[1..] });
    write(&folder, "rgbd/0.conf", if which == 3 { bytes } else { &LZFSE_CONFIDENCE[1..] });
    write(&folder, "metadata", if which == 4 { bytes } else { &METADATA[1..] });
    let source = match FolderSource::open(&folder, None, None) {
        Ok(source) => source,
        Err(error) => {
            assert!(which == 4 && error.to_string().contains("record3d"), "{error}");
            return;
        }
    };
    source.camera().check().expect("a camera that was taken holds its rules");
    let n_pixels = (source.camera().width * source.camera().height) as usize;
    let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
    let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
    if let Err(error) = source.read(0, &mut buffers) {
        assert!(error.to_string().contains("frame 0"), "{error}");
    }
    if let Err(error) = source.inspect(0) {
        assert!(error.to_string().contains("frame 0"), "{error}");
    }
}

/// ScanNet's `.sens`, and Record3D's `.r3d`: known by their names.
fn named(folder: &Path, name: &str, bytes: &[u8]) {
    write(folder, name, bytes);
    let spec = SourceSpec::parse(&folder.join(name).display().to_string());
    let options = SourceOptions::default();
    match tessera_sources::open(&spec, &options) {
        Ok(source) => read_all(&*source, name),
        Err(error) => assert!(error.to_string().contains(name), "{error}"),
    }
}

/// Images of Record3D as Apple's own library compresses them, each behind the byte of its kind.
const LZFSE_DEPTH: &[u8] = include_bytes!("corpus/images/lzfse_depth");
const LZFSE_CONFIDENCE: &[u8] = include_bytes!("corpus/images/lzfse_confidence");
const METADATA: &[u8] = include_bytes!("corpus/images/record3d_metadata");

/// A depth image as the camera expects it.
const DEPTH: &[u8] = include_bytes!("depth.png");

/// Bytes that stand in a journal as they are.
struct Raw<'a>(&'a [u8]);

impl Serialize for Raw<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        self.0.iter().try_for_each(|byte| tuple.serialize_element(byte))?;
        tuple.end()
    }
}

impl<'de> Deserialize<'de> for Raw<'_> {
    fn deserialize<D: Deserializer<'de>>(_: D) -> Result<Self, D::Error> {
        Err(serde::de::Error::custom("never read"))
    }
}

/// Journals. The first byte says whether what follows is the whole file, or one whole record with a
/// good checksum.
pub fn journal(bytes: &[u8]) {
    let Some((which, bytes)) = bytes.split_first() else { return };
    in_folder(|folder| {
        let path = folder.join("align.journal");
        let _ = std::fs::remove_file(&path);
        match which % 3 {
            0 => write(folder, "align.journal", bytes),
            1 => sealed(&path, ALIGN_JOURNAL, bytes),
            _ => sealed(&path, OPTIMISE_JOURNAL, bytes),
        }
        if which % 3 == 2 {
            let _ = Journal::open(&path, OPTIMISE_JOURNAL, Duration::ZERO, |_| Ok(()));
            return;
        }
        let mut state = TrackerState::default();
        let opened = Journal::open(&path, ALIGN_JOURNAL, Duration::ZERO, |record| {
            state.apply(&record);
            Ok(())
        });
        let n_records = match opened {
            Ok((_, recovered)) => recovered.n_records,
            Err(error) => return assert!(error.to_string().contains("align.journal"), "{error}"),
        };
        // What is left is whole, and a follower reads the same.
        let mut follower = Follower::open(&path, ALIGN_JOURNAL).expect("it is there");
        for k in 0..n_records {
            assert!(follower.next().is_ok_and(|record| record.is_some()), "record {k} of {n_records}");
        }
        assert!(follower.next().is_ok_and(|record| record.is_none()));
        assert_eq!(follower.bytes_left().expect("it is there"), 0);
    });
}

/// Writes a journal of one record with this payload, whatever it is.
pub fn sealed<T>(path: &Path, kind: RecordKind<T>, payload: &[u8]) {
    let kind = RecordKind::<Raw<'_>>::only(kind.name, kind.version);
    let (mut journal, _) = Journal::open(path, kind, Duration::ZERO, |_| Ok(())).expect("a new file");
    journal.append(&Raw(payload), false).expect("the record fits");
}

/// Messages from shared memory, whose payload is what follows the header, and surfaces as they travel in a fleet.
pub fn messages(bytes: &[u8]) {
    let Some((which, bytes)) = bytes.split_first() else { return };
    match which % 7 {
        0 => {
            let Some((header, rest)) = split::<FrameHeader>(bytes) else { return };
            let shape = FrameShape { width: 4, height: 4 };
            let payload: Vec<u16> = rest.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
            if header.validate(shape, Some(100)).is_ok() {
                assert!(header.index < 100);
            }
            if let Ok(read) = header.payload(shape, &payload) {
                assert_eq!(read.depth.len(), 16);
                assert!(read.colour.is_none_or(|colour| colour.len() == 48));
            }
        }
        1 => {
            let Some((header, rest)) = split::<SurfaceHeader>(bytes) else { return };
            let size = size_of::<Vertex>();
            let vertices: Vec<Vertex> = rest.chunks_exact(size).map(bytemuck::pod_read_unaligned).collect();
            let grid = Grid { width: 2, height: 2, step: 4 };
            if header.validate(&SurfaceExpectation { grid, limit: Some(100) }, &vertices).is_ok() {
                let valid = vertices.iter().filter(|v| v.is_valid());
                assert!(valid.flat_map(|v| v.position).all(f32::is_finite), "a vertex nowhere");
            }
        }
        2 => {
            let Some((beat, _)) = split::<Beat>(bytes) else { return };
            if let Ok((stage, state, on)) = beat.validate() {
                assert!(!stage.name().is_empty() && !state.name().is_empty());
                let _ = on.name();
            }
        }
        3 => {
            let Some((flow, _)) = split::<Flow>(bytes) else { return };
            let _ = flow.validate();
        }
        4 => {
            let Some((pose, _)) = split::<PoseMessage>(bytes) else { return };
            let _ = pose.reason_text();
            if pose.validate().is_ok() {
                assert!(pose.odom_from_camera.iter().all(|v| v.is_finite()));
            }
        }
        5 => {
            let Some((header, rest)) = split::<CameraFrame>(bytes) else { return };
            let shape = FrameShape { width: 16, height: 16 };
            let is_good = header.validate(shape).is_ok();
            if is_good && header.kind == 0 && header.check_payload(shape, rest.len() / 2).is_ok() {
                assert!(rest.len() / 2 >= shape.n_pixels());
                assert!(header.index.checked_add(header.index).is_some());
            }
            if let Ok(Some(camera)) = header.camera() {
                camera.check().expect("a camera that was taken holds its rules");
            }
        }
        _ => {
            let grid = Grid { width: 9, height: 6, step: 4 };
            let beside: Vec<usize> = (0..grid.len()).step_by(3).collect();
            let Ok(vertices) = unpack_spread(grid, bytes, &beside) else { return };
            assert_eq!(vertices.len(), grid.len());
            let numbers = vertices.iter().flat_map(|v| v.position.into_iter().chain(v.normal));
            assert!(numbers.into_iter().all(f32::is_finite), "a vertex nowhere");
        }
    }
}

fn split<T: bytemuck::AnyBitPattern>(bytes: &[u8]) -> Option<(T, &[u8])> {
    let (head, rest) = bytes.split_at_checked(size_of::<T>())?;
    Some((bytemuck::pod_read_unaligned(head), rest))
}
