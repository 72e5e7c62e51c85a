//! A valid recording in MCAP with messages of ROS 2, and faults of one message.

use super::*;
use std::io::Cursor;
use tessera_recording::ros::{CameraInfo, Header, Image, Time, encode};

const TOPICS: [(&str, &str); 3] = [
    ("/camera/depth/image_raw", "sensor_msgs/msg/Image"),
    ("/camera/color/image_raw", "sensor_msgs/msg/Image"),
    ("/camera/depth/camera_info", "sensor_msgs/msg/CameraInfo"),
];

/// A message of one of the topics; of its bytes the first are its head.
#[derive(Clone)]
pub(super) struct Message {
    topic: usize,
    log_nanos: u64,
    data: Vec<u8>,
    n_head: usize,
}

pub(super) fn messages(frames: &[Simulated]) -> Vec<Message> {
    let mut messages = Vec::new();
    for frame in frames {
        let log_nanos = frame.stamp_nanos as u64 + 5_000_000;
        let (sec, nanosec) = (frame.stamp_nanos / 1_000_000_000, frame.stamp_nanos % 1_000_000_000);
        let header =
            || Header { stamp: Time { sec: sec as i32, nanosec: nanosec as u32 }, frame_id: "camera".into() };
        let (width, height) = SIZE;
        let mut image = |topic, encoding: &'static str, data: &[u8]| {
            let step = data.len() as u32 / height;
            let n_pixels = data.len();
            let image = Image {
                header: header(),
                height,
                width,
                encoding: encoding.into(),
                is_bigendian: 0,
                step,
                data,
            };
            let data = encode(&image).unwrap();
            messages.push(Message { topic, log_nanos, n_head: data.len() - n_pixels, data });
        };
        image(0, "16UC1", bytemuck::cast_slice(&frame.depth));
        image(1, "rgb8", &frame.rgb);
        let Camera { fx, fy, cx, cy, .. } = camera();
        let info = CameraInfo {
            header: header(),
            height,
            width,
            distortion_model: "plumb_bob".into(),
            d: vec![0.0; 5],
            k: [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
            binning: [0; 2],
            region: Default::default(),
        };
        let data = encode(&info).unwrap();
        messages.push(Message { topic: 2, log_nanos, n_head: data.len(), data });
    }
    messages
}

pub(super) fn written(messages: &[Message]) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut bytes).unwrap();
    let channels = TOPICS.map(|(topic, kind)| {
        let schema = writer.add_schema(kind, "ros2msg", b"").unwrap();
        writer.add_channel(schema, topic, "cdr", &Default::default()).unwrap()
    });
    for message in messages {
        let header = mcap::records::MessageHeader {
            channel_id: channels[message.topic],
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

/// What happened to the messages. Of the camera no number changes: another number is another camera.
pub(super) fn fault(messages: &mut Vec<Message>, chance: &mut SplitMix64) -> String {
    let at = chance.below(messages.len());
    let what = format!("message {at} of {}", TOPICS[messages[at].topic].0);
    match chance.below(8) {
        0 => {
            messages.remove(at);
            format!("{what} is gone")
        }
        1 => {
            let other = messages[at].clone();
            messages.insert(at, other);
            format!("{what} is there twice")
        }
        2 => {
            let n = chance.below(messages[at].data.len());
            messages[at].data.truncate(n);
            format!("{what} has {n} bytes")
        }
        3 => {
            let other = chance.below(messages.len());
            messages.swap(at, other);
            format!("messages {at} and {other} are swapped")
        }
        4 => {
            messages[at..].iter_mut().for_each(|message| message.data[4..12].fill(0));
            format!("stamps are not set from message {at} on")
        }
        5 => {
            let seconds = [1, 3600][chance.below(2)];
            for message in &mut messages[at..] {
                let stamp = i32::from_le_bytes(message.data[4..8].try_into().unwrap()) - seconds;
                message.data[4..8].copy_from_slice(&stamp.to_le_bytes());
            }
            format!("the clock is set back by {seconds} s at message {at}")
        }
        _ => {
            let message = &mut messages[at];
            let n = if message.topic == 2 { 40 } else { message.n_head };
            let (byte, bit) = (chance.below(n), chance.below(8));
            message.data[byte] ^= 1 << bit;
            format!("{what}: bit {bit} of byte {byte} of {n}")
        }
    }
}
