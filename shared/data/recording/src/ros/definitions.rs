//! The texts that define messages, as an MCAP schema of encoding `ros2msg` has them.

/// A message's name and the text that defines it, with those of its parts.
#[derive(Clone, Copy, Debug)]
pub struct Definition {
    /// Full name, as `nav_msgs/msg/Path`.
    pub name: &'static str,
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

/// `geometry_msgs/msg/PoseStamped`.
pub const POSE: Definition = Definition {
    name: "geometry_msgs/msg/PoseStamped",
    parts: &["geometry_msgs/Point", "geometry_msgs/Quaternion", "geometry_msgs/Pose"],
    text: "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
};

/// `nav_msgs/msg/Path`.
pub const PATH: Definition = Definition {
    name: "nav_msgs/msg/Path",
    parts: &[
        "geometry_msgs/Point",
        "geometry_msgs/Quaternion",
        "geometry_msgs/Pose",
        "geometry_msgs/PoseStamped",
    ],
    text: "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
};

/// `tf2_msgs/msg/TFMessage`.
pub const TRANSFORMS: Definition = Definition {
    name: "tf2_msgs/msg/TFMessage",
    parts: &[
        "geometry_msgs/Vector3",
        "geometry_msgs/Quaternion",
        "geometry_msgs/Transform",
        "geometry_msgs/TransformStamped",
    ],
    text: "geometry_msgs/TransformStamped[] transforms\n",
};

/// `sensor_msgs/msg/PointCloud2`.
pub const CLOUD: Definition = Definition {
    name: "sensor_msgs/msg/PointCloud2",
    parts: &[],
    text: "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n\
           bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
};

const POINT_FIELD: &str = "string name\nuint32 offset\nuint8 datatype\nuint32 count\n";

impl Definition {
    /// The text with its parts behind it, as MCAP wants it.
    pub fn whole(&self) -> String {
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
