//! A run as an MCAP file of ROS 2 messages, which Foxglove and the tools of ROS 2 read.

use ::mcap::records::MessageHeader;
use ::mcap::{WriteOptions, Writer};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{self, Cursor, Write};
use tessera_fusion::Mesh;
use tessera_geometry::Pose;
use tessera_recording::ros::{
    self, Definition, Header, Path, PointCloud, PoseStamped, Time, TransformStamped, Transforms,
};

/// Frame of the map.
const WORLD: &str = "world";
/// Frame of the camera: x right, y down, z forward, an optical frame of ROS.
const CAMERA: &str = "camera";

/// What is written.
pub(crate) struct Contents<'a> {
    /// Final poses of all frames.
    pub frames: &'a [(i64, Pose)],
    /// Final poses of the run's keyframes.
    pub keyframes: &'a [(i64, Pose)],
    pub map: &'a Mesh,
}

type Buffer = Cursor<Vec<u8>>;

/// Channels as they are made, and messages behind them.
struct ExportTopics {
    writer: Writer<Buffer>,
    channels: BTreeMap<&'static str, u16>,
    sequence: u32,
}

impl ExportTopics {
    fn write<T: Serialize>(
        &mut self,
        topic: &'static str,
        definition: &Definition,
        stamp_nanos: i64,
        message: &T,
    ) -> io::Result<()> {
        let channel_id = match self.channels.get(topic) {
            Some(id) => *id,
            None => {
                let text = definition.whole();
                let schema = self.writer.add_schema(definition.name, "ros2msg", text.as_bytes());
                let schema = schema.map_err(io::Error::other)?;
                let id = self.writer.add_channel(schema, topic, "cdr", &BTreeMap::new());
                let id = id.map_err(io::Error::other)?;
                self.channels.insert(topic, id);
                id
            }
        };
        let bytes = ros::encode(message).map_err(io::Error::other)?;
        let time = u64::try_from(stamp_nanos).unwrap_or(0);
        let header =
            MessageHeader { channel_id, sequence: self.sequence, log_time: time, publish_time: time };
        self.sequence = self.sequence.wrapping_add(1);
        self.writer.write_to_known_channel(&header, &bytes).map_err(io::Error::other)
    }
}

/// Writes poses and transforms at their times, and the path, the keyframes and the map at the last.
pub(crate) fn write(contents: &Contents<'_>, out: &mut dyn Write) -> io::Result<()> {
    let options = WriteOptions::new().profile("ros2").library(concat!("tessera ", env!("CARGO_PKG_VERSION")));
    let writer = options.create(Cursor::new(Vec::new())).map_err(io::Error::other)?;
    let mut topics = ExportTopics { writer, channels: BTreeMap::new(), sequence: 0 };
    for (stamp_nanos, pose) in contents.frames {
        let header = header(*stamp_nanos);
        let transform = TransformStamped { header, child_frame_id: CAMERA.into(), transform: pose.into() };
        let transforms = Transforms { transforms: vec![transform] };
        topics.write("/tf", &ros::TRANSFORMS, *stamp_nanos, &transforms)?;
        topics.write("/tessera/pose", &ros::POSE, *stamp_nanos, &stamped(*stamp_nanos, pose))?;
    }
    let last = contents.frames.last().map_or(0, |(stamp_nanos, _)| *stamp_nanos);
    for (topic, rows) in [("/tessera/path", contents.frames), ("/tessera/keyframes", contents.keyframes)] {
        let poses = rows.iter().map(|(stamp_nanos, pose)| stamped(*stamp_nanos, pose)).collect();
        topics.write(topic, &ros::PATH, last, &Path { header: header(last), poses })?;
    }
    write_map(&mut topics, contents.map, last)?;
    topics.writer.finish().map_err(io::Error::other)?;
    out.write_all(topics.writer.into_inner().get_ref())
}

fn header(stamp_nanos: i64) -> Header<'static> {
    Header { stamp: Time::from_nanos(stamp_nanos), frame_id: WORLD.into() }
}

fn stamped(stamp_nanos: i64, pose: &Pose) -> PoseStamped<'static> {
    PoseStamped { header: header(stamp_nanos), pose: pose.into() }
}

/// Position, packed colour and normal of each vertex, as the viewers of ROS expect them.
fn write_map(topics: &mut ExportTopics, map: &Mesh, stamp_nanos: i64) -> io::Result<()> {
    let names = ["x", "y", "z", "rgb", "normal_x", "normal_y", "normal_z"];
    let mut data = Vec::with_capacity(4 * names.len() * map.positions.len());
    for ((position, normal), [red, green, blue]) in map.positions.iter().zip(&map.normals).zip(&map.colours) {
        position.iter().for_each(|v| data.extend(v.to_le_bytes()));
        data.extend([*blue, *green, *red, 0]);
        normal.iter().for_each(|v| data.extend(v.to_le_bytes()));
    }
    let cloud = PointCloud::in_a_row(header(stamp_nanos), &names, &data);
    topics.write("/tessera/map", &ros::CLOUD, stamp_nanos, &cloud)
}
