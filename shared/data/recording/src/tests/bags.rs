//! Bags of ROS 1 and in SQLite, small ones of rosbags: whole, cut, damaged and odd.
//!
//! Each has six images of depth and of colour at seconds 0 to 5; the database has pages of 512 bytes,
//! so that its tables have several levels and its images overflow.

use super::*;

const PLAIN: &[u8] = include_bytes!("../../../../../fuzz/corpus/recording/ros1_plain");
const BZ2: &[u8] = include_bytes!("../../../../../fuzz/corpus/recording/ros1_bz2");
const LZ4: &[u8] = include_bytes!("../../../../../fuzz/corpus/recording/ros1_lz4");
const SQLITE: &[u8] = include_bytes!("../../../../../fuzz/corpus/recording/ros2_sqlite");
const N_PIXELS: usize = 16 * 16;

fn open_file(path: &Path) -> Result<RecordingSource, String> {
    RecordingSource::open(path, &RecordingOptions::default(), None).map_err(|error| error.to_string())
}

fn open(bytes: &[u8]) -> Result<RecordingSource, String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("my.bag");
    std::fs::write(&path, bytes).unwrap();
    // The file stays open when its name is gone.
    open_file(&path)
}

fn refusal(bytes: &[u8]) -> String {
    open(bytes).err().expect("it should be refused")
}

fn read(source: &RecordingSource, index: u64) -> Result<(Vec<u16>, Vec<u8>), String> {
    let (mut depth, mut colour) = (vec![0; N_PIXELS], vec![0; 3 * N_PIXELS]);
    let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
    let info = source.read(index, &mut buffers).map_err(|error| error.to_string())?;
    assert_eq!(info.stamp_nanos, index as i64 * 1_000_000_000);
    Ok((depth, colour))
}

/// Depth and colour of a frame as they were written.
fn written(index: u64) -> (Vec<u16>, Vec<u8>) {
    let first = 1000 + 100 * index as u16;
    ((first..).take(N_PIXELS).collect(), vec![10 + index as u8; 3 * N_PIXELS])
}

fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|window| window == from).unwrap();
    [&bytes[..at], to, &bytes[at + from.len()..]].concat()
}

#[test]
fn frames_are_read_in_any_order() {
    let kinds = [
        ("bag of ROS 1", PLAIN),
        ("bag of ROS 1", BZ2),
        ("bag of ROS 1", LZ4),
        ("bag of ROS 2 in SQLite", SQLITE),
    ];
    for (kind, bytes) in kinds {
        let source = open(bytes).unwrap();
        assert_eq!(source.description()[0], ("layout", kind.to_owned()));
        assert_eq!((source.n_frames(), source.warnings()), (Some(6), &[] as &[String]), "{kind}");
        assert_eq!((source.camera().fx, source.camera().units_per_metre), (14.0, 1000.0));
        for index in [5, 0, 3] {
            assert!(read(&source, index).unwrap() == written(index), "{kind}: frame {index}");
        }
    }
}

#[test]
fn a_bag_of_ros_1_that_was_cut_or_never_closed_is_read_as_far_as_it_goes() {
    for whole in [PLAIN, BZ2, LZ4] {
        let mut n_before = 0;
        for percent in [65, 80] {
            let source = open(&whole[..whole.len() * percent / 100]).unwrap();
            let n = source.n_frames().unwrap();
            assert!(n > n_before && n <= 6, "{n} at {percent} %");
            n_before = n;
            assert!(source.warnings()[0].contains("is not whole, the file has"), "{:?}", source.warnings());
            // The colour of the last may have been cut off.
            assert!(read(&source, n - 1).unwrap().0 == written(n - 1).0);
        }
    }
    // A recorder that is killed leaves the place of the index 0, and no index.
    let at = PLAIN.windows(10).position(|window| window == b"index_pos=").unwrap() + 10;
    let end = u64::from_le_bytes(std::array::from_fn(|k| PLAIN[at + k])) as usize;
    let mut open_bag = PLAIN[..end].to_vec();
    open_bag[at..at + 8].fill(0);
    let source = open(&open_bag).unwrap();
    assert_eq!(source.n_frames(), Some(6));
    assert!(source.warnings()[0].contains("the bag was never closed"), "{:?}", source.warnings());
    assert!(read(&source, 5).unwrap() == written(5));
}

#[test]
fn damage_never_ends_in_a_panic_or_in_a_hang() {
    for whole in [BZ2, LZ4, SQLITE, PLAIN] {
        let mut n_refused = 0;
        for at in (0..whole.len()).step_by(23) {
            let mut damaged = whole.to_vec();
            damaged[at] ^= 0x41;
            let error = match open(&damaged) {
                Ok(source) => (0..source.n_frames().unwrap().min(6)).find_map(|index| {
                    let (mut depth, mut colour) = (vec![0; N_PIXELS], vec![0; 3 * N_PIXELS]);
                    let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
                    source.read(index, &mut buffers).err().map(|error| error.to_string())
                }),
                Err(error) => Some(error),
            };
            if let Some(error) = error {
                assert!(error.contains("my.bag") || error.contains("expected"), "byte {at}: {error}");
                n_refused += 1;
            }
        }
        assert!(n_refused > 3, "{n_refused}");
    }
}

#[test]
fn bags_that_are_not_read_are_named() {
    assert!(refusal(b"#ROSBAG V1.2\n").contains("expected '#ROSBAG V2.0\\n'; older bags: rosbag fix"));
    let other = refusal(&replaced(LZ4, b"compression=lz4", b"compression=zip"));
    assert!(other.contains("its compression is 'zip', expected none, bz2 or lz4"), "{other}");
}

#[test]
fn databases_that_are_no_whole_bags_are_named() {
    assert!(refusal(&SQLITE[..50]).contains("was cut within its header"));
    let cut = refusal(&SQLITE[..SQLITE.len() / 2]);
    assert!(cut.contains("an SQLite database that was cut") && cut.contains(".recover"), "{cut}");
    let no_bag = refusal(&replaced(SQLITE, b"tablemessagesmessages", b"tableaessagesmessages"));
    assert!(no_bag.contains("expected a bag of ROS 2") && no_bag.contains("aessages"), "{no_bag}");
    let mut utf16 = SQLITE.to_vec();
    utf16[56..60].copy_from_slice(&2_u32.to_be_bytes());
    assert!(refusal(&utf16).contains("text encoding 2, expected UTF-8"));
    let mut pages = SQLITE.to_vec();
    pages[16..18].copy_from_slice(&600_u16.to_be_bytes());
    assert!(refusal(&pages).contains("pages of 600 bytes"));
    // Written and not folded in yet.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("my.db3");
    std::fs::write(&path, SQLITE).unwrap();
    std::fs::write(folder.path().join("my.db3-wal"), "").unwrap();
    assert!(open_file(&path).is_ok(), "an empty log says nothing");
    std::fs::write(folder.path().join("my.db3-wal"), "pages").unwrap();
    let words = open_file(&path).err().unwrap();
    assert!(words.contains("has a write-ahead log beside it") && words.contains("wal_checkpoint"), "{words}");
}

/// Written by librealsense 2.55 and 2.58 from a software device: depth of 1 m in units of 0.25 mm, and a colour
/// camera 0.1 m to the right whose red is its column.
const REALSENSE: [(&str, &[u8]); 2] = [
    ("my.bag", include_bytes!("../../../../../fuzz/corpus/recording/librealsense_bag")),
    ("my.db3", include_bytes!("../../../../../fuzz/corpus/recording/librealsense_db3")),
];

#[test]
fn recordings_of_librealsense_have_its_units_and_its_two_cameras() {
    for (name, bytes) in REALSENSE {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let source = RecordingSource::open(&path, &RecordingOptions::default(), None).unwrap();
        let camera = source.camera();
        assert_eq!((camera.fx, camera.cx, camera.units_per_metre), (20.0, 9.5, 4000.0), "{name}");
        assert_eq!(source.n_frames(), Some(3), "{name}: {:?}", source.warnings());
        let (depth, colour, info) = super::read(&source, 1);
        assert!(depth.iter().all(|raw| *raw == 4001) && info.has_colour, "{name}: {:?}", source.warnings());
        // At 1 m a point of column c is seen 0.1 * 40 px further left, in an image twice as wide.
        for column in [5, 10, 15] {
            let red = i32::from(colour[3 * (20 * 8 + column)]);
            assert!((red - (2 * column as i32 - 4)).abs() <= 1, "{name}: {red} at {column}");
        }
    }
}
