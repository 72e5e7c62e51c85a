//! Small recordings of ROS 2 in MCAP, whatever may be wrong with them.

use mcap::records::MessageHeader;
use std::path::Path;

/// Sides of the images, pixels.
pub const SIDE: u32 = 16;

/// A message in CDR, little endian; each number is aligned to its size behind the first four bytes.
#[derive(Default)]
struct Cdr(Vec<u8>);

impl Cdr {
    fn put(mut self, bytes: &[u8], align: usize) -> Self {
        self.0.resize(self.0.len().next_multiple_of(align), 0);
        self.0.extend(bytes);
        self
    }

    fn words(self, words: &[u32]) -> Self {
        words.iter().fold(self, |cdr, word| cdr.put(&word.to_le_bytes(), 4))
    }

    fn text(self, text: &str) -> Self {
        self.words(&[text.len() as u32 + 1]).put(text.as_bytes(), 1).put(&[0], 1)
    }

    fn reals(self, reals: &[f64]) -> Self {
        reals.iter().fold(self, |cdr, real| cdr.put(&real.to_le_bytes(), 8))
    }

    fn header(seconds: u32) -> Self {
        Self::default().words(&[seconds, 0]).text("camera")
    }

    fn finish(self) -> Vec<u8> {
        [&[0, 1, 0, 0][..], &self.0].concat()
    }
}

/// A message of a topic.
pub struct Message {
    topic: &'static str,
    schema: &'static str,
    data: Vec<u8>,
}

/// `sensor_msgs/msg/Image` with two bytes a pixel.
pub fn image(topic: &'static str, seconds: u32, encoding: &str) -> Message {
    let pixels = vec![4; (2 * SIDE * SIDE) as usize];
    let cdr = Cdr::header(seconds).words(&[SIDE, SIDE]).text(encoding).put(&[0], 1);
    let cdr = cdr.words(&[2 * SIDE, pixels.len() as u32]).put(&pixels, 1);
    Message { topic, schema: "sensor_msgs/msg/Image", data: cdr.finish() }
}

/// `sensor_msgs/msg/CameraInfo`.
pub fn camera_info(topic: &'static str, model: &str, distortion: &[f64]) -> Message {
    let cdr = Cdr::header(0).words(&[SIDE, SIDE]).text(model);
    let cdr = cdr.words(&[distortion.len() as u32]).reals(distortion);
    let cdr = cdr.reals(&[14.0, 0.0, 7.5, 0.0, 14.0, 7.5, 0.0, 0.0, 1.0]).reals(&[0.0; 9 + 12]);
    // Binning and the region of interest.
    let data = cdr.words(&[0; 6]).put(&[0], 1).finish();
    Message { topic, schema: "sensor_msgs/msg/CameraInfo", data }
}

/// Writes a recording.
pub fn write(path: &Path, messages: &[Message]) {
    let file = std::fs::File::create(path).unwrap();
    let mut writer = mcap::WriteOptions::new().compression(None).create(file).unwrap();
    for (at, message) in messages.iter().enumerate() {
        let schema = writer.add_schema(message.schema, "ros2msg", b"").unwrap();
        let channel_id = writer.add_channel(schema, message.topic, "cdr", &Default::default()).unwrap();
        let time = at as u64;
        let header = MessageHeader { channel_id, sequence: at as u32, log_time: time, publish_time: time };
        writer.write_to_known_channel(&header, &message.data).unwrap();
    }
    writer.finish().unwrap();
}
