//! Messages of ROS 2 as they are written: their fields in order, and the texts that define them.

use serde::Serialize;
use tessera_geometry::Pose;

#[derive(Clone, Copy, Serialize)]
pub(super) struct Time {
    sec: i32,
    nanosec: u32,
}

impl Time {
    /// Times before 1901 and after 2038 do not fit and are the nearest that do.
    pub(super) fn of(stamp_nanos: i64) -> Self {
        const SECOND: i64 = 1_000_000_000;
        let most = i64::from(i32::MAX);
        let sec = stamp_nanos.div_euclid(SECOND).clamp(-most, most) as i32;
        Self { sec, nanosec: stamp_nanos.rem_euclid(SECOND) as u32 }
    }
}

/// `std_msgs/Header`.
#[derive(Clone, Serialize)]
pub(super) struct Header {
    pub(super) stamp: Time,
    pub(super) frame_id: &'static str,
}

/// `geometry_msgs/Pose`, and with it `geometry_msgs/Transform`, whose layout is the same.
#[derive(Clone, Copy, Serialize)]
pub(super) struct PoseMessage {
    position: [f64; 3],
    orientation_xyzw: [f64; 4],
}

impl From<&Pose> for PoseMessage {
    fn from(pose: &Pose) -> Self {
        let (t, q) = (&pose.translation.vector, pose.rotation.quaternion());
        Self { position: [t.x, t.y, t.z], orientation_xyzw: [q.i, q.j, q.k, q.w] }
    }
}

/// `geometry_msgs/PoseStamped`.
#[derive(Clone, Serialize)]
pub(super) struct PoseStamped {
    pub(super) header: Header,
    pub(super) pose: PoseMessage,
}

/// `nav_msgs/Path`.
#[derive(Serialize)]
pub(super) struct Path {
    pub(super) header: Header,
    pub(super) poses: Vec<PoseStamped>,
}

/// `tf2_msgs/TFMessage`.
#[derive(Serialize)]
pub(super) struct Transforms {
    pub(super) transforms: Vec<TransformStamped>,
}

/// `geometry_msgs/TransformStamped`.
#[derive(Serialize)]
pub(super) struct TransformStamped {
    pub(super) header: Header,
    pub(super) child_frame_id: &'static str,
    pub(super) transform: PoseMessage,
}

/// `sensor_msgs/PointField`.
#[derive(Serialize)]
pub(super) struct PointField {
    pub(super) name: &'static str,
    pub(super) offset: u32,
    pub(super) datatype: u8,
    pub(super) count: u32,
}

/// `sensor_msgs/PointCloud2`.
#[derive(Serialize)]
pub(super) struct PointCloud<'a> {
    pub(super) header: Header,
    pub(super) height: u32,
    pub(super) width: u32,
    pub(super) fields: Vec<PointField>,
    pub(super) is_bigendian: bool,
    pub(super) point_step: u32,
    pub(super) row_step: u32,
    #[serde(with = "serde_bytes")]
    pub(super) data: &'a [u8],
    pub(super) is_dense: bool,
}

/// A message's name and the text that defines it, with those of its parts.
pub(super) struct Definition {
    pub(super) name: &'static str,
    parts: &'static [&'static str],
    text: &'static str,
}

const PARTS: [(&str, &str); 9] = [
    ("builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"),
    ("geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"),
    ("geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"),
    ("geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"),
    (
        "geometry_msgs/TransformStamped",
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
    ),
];

const HEAD: [&str; 2] = ["builtin_interfaces/Time", "std_msgs/Header"];

pub(super) const POSE: Definition = Definition {
    name: "geometry_msgs/msg/PoseStamped",
    parts: &["geometry_msgs/Point", "geometry_msgs/Quaternion", "geometry_msgs/Pose"],
    text: "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
};

pub(super) const PATH: Definition = Definition {
    name: "nav_msgs/msg/Path",
    parts: &[
        "geometry_msgs/Point",
        "geometry_msgs/Quaternion",
        "geometry_msgs/Pose",
        "geometry_msgs/PoseStamped",
    ],
    text: "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
};

pub(super) const TRANSFORMS: Definition = Definition {
    name: "tf2_msgs/msg/TFMessage",
    parts: &[
        "geometry_msgs/Vector3",
        "geometry_msgs/Quaternion",
        "geometry_msgs/Transform",
        "geometry_msgs/TransformStamped",
    ],
    text: "geometry_msgs/TransformStamped[] transforms\n",
};

pub(super) const CLOUD: Definition = Definition {
    name: "sensor_msgs/msg/PointCloud2",
    parts: &[],
    text: "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n\
           bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
};

const POINT_FIELD: &str = "string name\nuint32 offset\nuint8 datatype\nuint32 count\n";

impl Definition {
    /// The text with its parts behind it, as MCAP wants it.
    pub(super) fn whole(&self) -> String {
        let mut text = self.text.to_owned();
        let mut add = |name: &str, part: &str| {
            text += &format!("{}\nMSG: {name}\n{part}", "=".repeat(80));
        };
        for (name, part) in PARTS {
            if HEAD.contains(&name) || self.parts.contains(&name) {
                add(name, part);
            }
        }
        if self.text.contains("PointField") {
            add("sensor_msgs/PointField", POINT_FIELD);
        }
        text
    }
}
