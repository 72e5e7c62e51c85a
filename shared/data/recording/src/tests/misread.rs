//! Recordings that were once read without a word and wrong: clocks that are set, stamps that are not,
//! topics that are declared and empty, colour that has no partner.

use super::*;

const SECOND: i64 = 1_000_000_000;
const STEP: i64 = 33_333_333;
const LOG: i64 = 1_700_000_000 * SECOND;

/// A message of the recording: topic, schema, time by the sensor (nanoseconds), encoding, bytes a pixel.
type Message = (&'static str, i64, &'static str, u32);

/// Writes messages in the order given, 33 ms apart by the clock of the recorder; topics without messages
/// may be declared.
fn written(messages: &[Message], declared: &[&'static str]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut bytes).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Image", "ros2msg", b"").unwrap();
    let mut topics: Vec<&str> =
        messages.iter().map(|message| message.0).chain(declared.iter().copied()).collect();
    topics.sort_unstable();
    topics.dedup();
    let channels: std::collections::BTreeMap<&str, u16> = topics
        .into_iter()
        .map(|topic| (topic, writer.add_channel(schema, topic, "cdr", &Default::default()).unwrap()))
        .collect();
    for (at, (topic, stamp, encoding, bytes_per_pixel)) in messages.iter().enumerate() {
        let stamp = [(stamp / SECOND) as u32, (stamp % SECOND) as u32];
        let data = image_at(stamp, encoding, *bytes_per_pixel, at as u8);
        // The second image of a pair is recorded soon after the first.
        let time = (LOG + (at / 2) as i64 * STEP + (at % 2) as i64 * STEP / 8) as u64;
        let header = MessageHeader {
            channel_id: channels[topic],
            sequence: at as u32,
            log_time: time,
            publish_time: time,
        };
        writer.write_to_known_channel(&header, &data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

/// Pairs of depth and colour with the given stamps.
fn pairs(stamps: &[i64]) -> Vec<Message> {
    stamps.iter().flat_map(|&stamp| [("/depth", stamp, "16UC1", 2), ("/rgb", stamp, "rgb8", 3)]).collect()
}

fn stamps(source: &RecordingSource) -> Vec<i64> {
    (0..source.n_frames().unwrap()).map(|index| source.stamp_nanos(index).unwrap()).collect()
}

/// The frames come in the order of the recording, each with the colour that was recorded with it.
fn check_order(source: &RecordingSource, n: u64) {
    assert_eq!(source.n_frames(), Some(n));
    let mut last = i64::MIN;
    for index in 0..n {
        let (depth, colour, info) = read(source, index);
        let value = 2 * index as u8;
        assert!(
            depth[0] == u16::from_le_bytes([value; 2]) && info.has_colour && colour[0] == value + 1,
            "frame {index}"
        );
        assert!(info.stamp_nanos > last, "frame {index}");
        last = info.stamp_nanos;
    }
}

#[test]
fn a_clock_that_is_set_back_keeps_the_order_of_the_recording() {
    for back in [6 * STEP, 6 * STEP - 5_000_000, 2 * STEP + 1_000_000, 1000 * SECOND] {
        let start = 5000 * SECOND;
        let stamps: Vec<i64> = (0..20).map(|k| start + k * STEP - if k >= 10 { back } else { 0 }).collect();
        let source = open(&written(&pairs(&stamps), &[])).unwrap();
        check_order(&source, 20);
        let warning = source.warnings().join("\n");
        assert!(
            warning.contains("/depth: the stamps go back by") && warning.contains("at image 11"),
            "{back}: {warning}"
        );
    }
    // A bag that was played twice into the recorder.
    let twice: Vec<i64> = (0..20).map(|k| 70 * SECOND + (k % 10) * STEP).collect();
    check_order(&open(&written(&pairs(&twice), &[])).unwrap(), 20);
}

#[test]
fn a_clock_that_is_set_ahead_is_a_new_stretch_and_a_pause_is_none() {
    let ahead: Vec<i64> =
        (0..20).map(|k| 70 * SECOND + k * STEP + if k >= 10 { 3600 * SECOND } else { 0 }).collect();
    let source = open(&written(&pairs(&ahead), &[])).unwrap();
    check_order(&source, 20);
    assert!(
        source.warnings().join("\n").contains("jump ahead by 3600.033 s at image 11"),
        "{:?}",
        source.warnings()
    );
    let times = stamps(&source);
    assert!(times[10] - times[9] < 2 * STEP, "{times:?}");
}

#[test]
fn stamps_that_are_not_set_or_equal_are_those_of_the_recording() {
    for stamp in [0, 1234 * SECOND] {
        let source = open(&written(&pairs(&[stamp; 12]), &[])).unwrap();
        check_order(&source, 12);
        assert!(stamps(&source)[3] - LOG < SECOND);
        assert!(
            source.warnings().join("\n").contains("the times of recording are used"),
            "{:?}",
            source.warnings()
        );
    }
    // Whole seconds, as where the nanoseconds were forgotten.
    let whole: Vec<i64> = (0..40).map(|k| (1000 * SECOND + k * STEP) / SECOND * SECOND).collect();
    check_order(&open(&written(&pairs(&whole), &[])).unwrap(), 40);
}

#[test]
fn a_topic_that_was_declared_and_never_sent_is_not_chosen() {
    let messages: Vec<Message> = (0..5)
        .flat_map(|k| {
            [
                ("/camera/depth/image_rect_raw", k * SECOND, "16UC1", 2),
                ("/camera/color/image_raw", k * SECOND, "rgb8", 3),
            ]
        })
        .collect();
    let declared = ["/camera/aligned_depth_to_color/image_raw", "/camera/rgb/image_color"];
    let source = open(&written(&messages, &declared)).unwrap();
    assert_eq!(source.description()[1].1, "/camera/depth/image_rect_raw");
    assert_eq!((source.n_frames(), source.pairing().n_pairs), (Some(5), 5));
}

#[test]
fn depth_is_known_by_what_a_topic_holds_where_no_name_says_so() {
    let messages: Vec<Message> = (0..5)
        .flat_map(|k| {
            [("/oak/stereo/image_raw", k * SECOND, "16UC1", 2), ("/oak/rgb/image_raw", k * SECOND, "rgb8", 3)]
        })
        .collect();
    let source = open(&written(&messages, &["/oak/rgb/image_raw/compressedDepth"])).unwrap();
    assert_eq!((source.description()[1].1.as_str(), source.pairing().n_pairs), ("/oak/stereo/image_raw", 5));
    // Depth painted in colours is none.
    let messages: Vec<Message> = (0..5)
        .flat_map(|k| [("/depth/colormap", k * SECOND, "rgb8", 3), ("/stereo/raw", k * SECOND, "16UC1", 2)])
        .collect();
    let source = open(&written(&messages, &[])).unwrap();
    assert_eq!(source.description()[1].1, "/stereo/raw");
}

#[test]
fn colour_without_a_partner_is_stated() {
    let mut messages: Vec<Message> = (0..5).map(|k| ("/depth", 50 * SECOND + k * STEP, "16UC1", 2)).collect();
    let source = open(&written(&messages, &[])).unwrap();
    assert_eq!(source.warnings(), ["no frame has colour: the recording has no colour topic"]);
    messages.extend((0..5).map(|k| ("/rgb", 55 * SECOND + k * STEP, "rgb8", 3)));
    let warning = open(&written(&messages, &[])).unwrap().warnings().join("\n");
    assert!(warning.contains("no frame has colour: ") && warning.contains("5.000 s later"), "{warning}");
}

#[test]
fn colour_as_cameras_give_it_is_decoded() {
    for (encoding, bytes_per_pixel) in [
        ("yuv422_yuy2", 2),
        ("yuv422", 2),
        ("bayer_rggb8", 1),
        ("bayer_gbrg16", 2),
        ("mono16", 2),
        ("rgb16", 6),
    ] {
        let messages: Vec<Message> = (0..3)
            .flat_map(|k| {
                [("/depth", k * SECOND, "16UC1", 2), ("/rgb", k * SECOND, encoding, bytes_per_pixel)]
            })
            .collect();
        let source = open(&written(&messages, &[])).unwrap();
        assert!(read(&source, 2).2.has_colour, "{encoding}");
        source.inspect(1).unwrap();
    }
    // One that is not known leaves depth as it is.
    let messages = [("/depth", 0, "16UC1", 2), ("/rgb", 0, "nv21", 2)];
    let source = open(&written(&messages, &[])).unwrap();
    let mut buffers = FrameBuffers { depth: &mut [9; 320], colour: &mut [9; 960] };
    let (info, problem) = source.read_what_is_there(0, &mut buffers).unwrap();
    assert!(!info.has_colour && buffers.depth[0] == 0, "{problem:?}");
    assert!(matches!(problem, Some(SourceError::Colour(_))), "{problem:?}");
}
