//! Recordings with a fault in one message, made by chance from a valid one: each is refused, or says what is
//! wrong, or has the frames of the valid one.

use super::*;
use tessera_numerics::SplitMix64;

/// Recordings made; each from a seed of its own. `TESSERA_SEED=N` tries others.
const N_MUTATIONS: u64 = 1000;
const N_FRAMES: u16 = 12;
const START: u64 = 1_700_000_000;
/// Where an image states the order of its bytes.
const ORDER_AT: usize = 38;
const STEP: u64 = 33_333_333;

/// A message: whether it is of depth, and its bytes, of which the first are its head.
#[derive(Clone)]
struct Message {
    is_depth: bool,
    log_nanos: u64,
    data: Vec<u8>,
    n_head: usize,
}

/// Depth whose value is its number, and colour.
fn valid() -> Vec<Message> {
    let n_pixels = (SIZE.0 * SIZE.1) as usize;
    let mut messages = Vec::new();
    for k in 0..N_FRAMES {
        let nanos = 100_000_000 + u64::from(k) * STEP;
        let stamp = [START as u32 + (nanos / 1_000_000_000) as u32, (nanos % 1_000_000_000) as u32];
        for (is_depth, encoding, bytes_per_pixel) in [(true, "16UC1", 2), (false, "rgb8", 3)] {
            let mut data = image_at(stamp, encoding, bytes_per_pixel, 90);
            let n_head = data.len() - n_pixels * bytes_per_pixel as usize;
            if is_depth {
                data[n_head..].copy_from_slice(&(1000 + k).to_le_bytes().repeat(n_pixels));
            }
            let log_nanos = START * 1_000_000_000 + nanos + 5_000_000;
            messages.push(Message { is_depth, log_nanos, data, n_head });
        }
    }
    messages
}

fn written(messages: &[Message]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut bytes).unwrap();
    let schema = writer.add_schema("sensor_msgs/msg/Image", "ros2msg", b"").unwrap();
    let [depth, colour] = ["/depth", "/rgb"]
        .map(|topic| writer.add_channel(schema, topic, "cdr", &Default::default()).unwrap());
    for message in messages {
        let header = MessageHeader {
            channel_id: if message.is_depth { depth } else { colour },
            sequence: 0,
            log_time: message.log_nanos,
            publish_time: message.log_nanos,
        };
        writer.write_to_known_channel(&header, &message.data).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    bytes.into_inner()
}

/// What happened to the messages.
fn fault(messages: &mut Vec<Message>, chance: &mut SplitMix64) -> String {
    let at = chance.below(messages.len());
    let what = if messages[at].is_depth { "depth" } else { "colour" };
    let frame = at / 2;
    match chance.below(7) {
        0 => {
            messages.remove(at);
            format!("{what} {frame} is gone")
        }
        1 => {
            let other = messages[at].clone();
            messages.insert(at, other);
            format!("{what} {frame} is there twice")
        }
        2 => {
            let n = chance.below(messages[at].data.len());
            messages[at].data.truncate(n);
            format!("{what} {frame} has {n} bytes")
        }
        3 => {
            let other = chance.below(messages.len());
            messages.swap(at, other);
            format!("messages {at} and {other} are swapped")
        }
        4 => {
            for message in &mut messages[at..] {
                message.data[4..12].fill(0);
            }
            format!("stamps are not set from message {at} on")
        }
        _ => {
            let byte = chance.below(messages[at].n_head);
            // The other order of bytes is a valid message too.
            let bit = chance.below(8).max(usize::from(byte == ORDER_AT));
            messages[at].data[byte] ^= 1 << bit;
            format!("{what} {frame}: bit {bit} of byte {byte} of {}", messages[at].n_head)
        }
    }
}

#[test]
fn a_recording_with_a_fault_is_refused_or_says_so_or_is_read_as_without_it() {
    let (n_pixels, whole) = ((SIZE.0 * SIZE.1) as usize, valid());
    let (mut n_refused, mut n_warned, mut n_same) = (0, 0, 0);
    let mut silent = Vec::new();
    let first = std::env::var("TESSERA_SEED").map_or(0, |seed| seed.parse().unwrap());
    for seed in first..first + N_MUTATIONS {
        let (mut chance, mut messages) = (SplitMix64::new(seed), whole.clone());
        let what = fault(&mut messages, &mut chance);
        let source = match open(&written(&messages)) {
            Err(_) => {
                n_refused += 1;
                continue;
            }
            Ok(source) => source,
        };
        if !source.warnings().is_empty() {
            n_warned += 1;
            continue;
        }
        n_same += 1;
        let mut seen = Vec::new();
        for index in 0..source.n_frames().unwrap() {
            let (mut depth, mut colour) = (vec![0; n_pixels], vec![0; 3 * n_pixels]);
            let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
            // One that is broken is named when it is read.
            if source.read_what_is_there(index, &mut buffers).unwrap().1.is_none() {
                seen.push((depth[0], colour[0], source.stamp_nanos(index).unwrap()));
            }
        }
        let is_rising = seen.windows(2).all(|pair| pair[0].0 < pair[1].0 && pair[0].2 < pair[1].2);
        let is_valid = |(value, colour, _): &(u16, u8, i64)| {
            (1000..1000 + N_FRAMES).contains(value) && [0, 90].contains(colour)
        };
        if !(is_rising && seen.iter().all(is_valid) && seen.len() + 1 >= usize::from(N_FRAMES)) {
            silent.push(format!("seed {seed}: {what}\n{seen:?}"));
        }
    }
    let shown = silent[..silent.len().min(12)].join("\n");
    assert!(silent.is_empty(), "{} are read otherwise without a word:\n{shown}", silent.len());
    // Each of these happens, so that none of the rules above is empty.
    assert!(n_refused > 0 && n_warned > 100 && n_same > 100, "{n_refused} {n_warned} {n_same}");
}
