//! The structs, as CDR has them.

use crate::messages::nanos;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use tessera_geometry::Pose;

/// `builtin_interfaces/msg/Time`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds after them.
    pub nanosec: u32,
}

impl Time {
    /// The time of a stamp. Times before 1901 and after 2038 do not fit and are the nearest that do.
    pub fn from_nanos(stamp_nanos: i64) -> Self {
        const SECOND: i64 = 1_000_000_000;
        let most = i64::from(i32::MAX);
        let sec = stamp_nanos.div_euclid(SECOND).clamp(most.saturating_neg(), most);
        let (sec, nanosec) = (i32::try_from(sec), u32::try_from(stamp_nanos.rem_euclid(SECOND)));
        Self { sec: sec.unwrap_or_default(), nanosec: nanosec.unwrap_or_default() }
    }

    /// The stamp, nanoseconds.
    pub fn nanos(&self) -> i64 {
        nanos(self.sec.into(), self.nanosec.into())
    }
}

/// `std_msgs/msg/Header`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header<'a> {
    /// Time of the data.
    pub stamp: Time,
    /// Coordinate frame of the data.
    #[serde(borrow)]
    pub frame_id: Cow<'a, str>,
}

/// `sensor_msgs/msg/Image`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Image<'a> {
    /// Time and frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Form of a pixel, as `16UC1`.
    #[serde(borrow)]
    pub encoding: Cow<'a, str>,
    /// Not 0 where numbers are big-endian.
    pub is_bigendian: u8,
    /// Bytes of a row.
    pub step: u32,
    /// The rows.
    #[serde(borrow, with = "serde_bytes")]
    pub data: &'a [u8],
}

/// `sensor_msgs/msg/CompressedImage`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CompressedImage<'a> {
    /// Time and frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Form of the file, as `jpeg`.
    #[serde(borrow)]
    pub format: Cow<'a, str>,
    /// The file.
    #[serde(borrow, with = "serde_bytes")]
    pub data: &'a [u8],
}

/// `sensor_msgs/msg/CameraInfo`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraInfo<'a> {
    /// Time and frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Rows of the images.
    pub height: u32,
    /// Columns of the images.
    pub width: u32,
    /// Name of the distortion model.
    #[serde(borrow)]
    pub distortion_model: Cow<'a, str>,
    /// Coefficients of the distortion.
    pub d: Vec<f64>,
    /// Intrinsic matrix of the raw images, by rows.
    pub k: [f64; 9],
    /// Rectification matrix, by rows.
    pub r: [f64; 9],
    /// Projection matrix of the rectified images, by rows.
    pub p: [f64; 12],
    /// Columns and rows that were combined into one; 0 is 1.
    pub binning: [u32; 2],
    /// Part of the camera's image that is sent.
    pub region: RegionOfInterest,
}

/// `sensor_msgs/msg/RegionOfInterest`, pixels before binning; without columns or rows it is the whole image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct RegionOfInterest {
    /// First column.
    pub x_offset: u32,
    /// First row.
    pub y_offset: u32,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// Whether it is of the rectified image.
    pub do_rectify: bool,
}

/// `sensor_msgs/msg/Imu`. Of a quantity that was not measured the first variance is -1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Imu<'a> {
    /// Time and frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Orientation, `x y z w`.
    pub orientation: [f64; 4],
    /// Its covariance, by rows.
    pub orientation_covariance: [f64; 9],
    /// Angular rate, radians per second.
    pub angular_velocity: [f64; 3],
    /// Its covariance, by rows.
    pub angular_velocity_covariance: [f64; 9],
    /// Specific force, metres per second squared.
    pub linear_acceleration: [f64; 3],
    /// Its covariance, by rows.
    pub linear_acceleration_covariance: [f64; 9],
}

/// `realsense2_camera_msgs/msg/Extrinsics`: from points of one camera to another.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Extrinsics {
    /// Rotation matrix, by columns.
    pub rotation: [f64; 9],
    /// Translation, metres.
    pub translation: [f64; 3],
}

/// `geometry_msgs/msg/Pose`, and with it `geometry_msgs/msg/Transform`, whose layout is the same.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RosPose {
    /// Translation, metres.
    pub position: [f64; 3],
    /// Rotation.
    pub orientation_xyzw: [f64; 4],
}

impl From<&Pose> for RosPose {
    fn from(pose: &Pose) -> Self {
        let (t, q) = (&pose.translation.vector, pose.rotation.quaternion());
        Self { position: [t.x, t.y, t.z], orientation_xyzw: [q.i, q.j, q.k, q.w] }
    }
}

/// `geometry_msgs/msg/PoseStamped`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseStamped<'a> {
    /// Time and frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// The pose in the header's frame.
    pub pose: RosPose,
}

/// `nav_msgs/msg/Path`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Path<'a> {
    /// Time and frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Poses in the order of time.
    #[serde(borrow)]
    pub poses: Vec<PoseStamped<'a>>,
}

/// `tf2_msgs/msg/TFMessage`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Transforms<'a> {
    /// The transforms.
    #[serde(borrow)]
    pub transforms: Vec<TransformStamped<'a>>,
}

/// `geometry_msgs/msg/TransformStamped`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TransformStamped<'a> {
    /// Time and parent frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Child frame.
    #[serde(borrow)]
    pub child_frame_id: Cow<'a, str>,
    /// `parent_from_child`.
    pub transform: RosPose,
}

/// `sensor_msgs/msg/PointField`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointField<'a> {
    /// Name of the field.
    #[serde(borrow)]
    pub name: Cow<'a, str>,
    /// Bytes before it in a point.
    pub offset: u32,
    /// Number of its type.
    pub datatype: u8,
    /// Elements.
    pub count: u32,
}

impl PointField<'_> {
    /// Datatype of 32-bit floats.
    pub const FLOAT32: u8 = 7;
}

/// `sensor_msgs/msg/PointCloud2`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PointCloud<'a> {
    /// Time and frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Rows of points.
    pub height: u32,
    /// Points of a row.
    pub width: u32,
    /// Fields of a point.
    #[serde(borrow)]
    pub fields: Vec<PointField<'a>>,
    /// Whether numbers are big-endian.
    pub is_bigendian: bool,
    /// Bytes of a point.
    pub point_step: u32,
    /// Bytes of a row.
    pub row_step: u32,
    /// The points.
    #[serde(borrow, with = "serde_bytes")]
    pub data: &'a [u8],
    /// Whether all points are finite.
    pub is_dense: bool,
}

impl<'a> PointCloud<'a> {
    /// Points in one row, whose fields are all of four bytes.
    pub fn in_a_row(header: Header<'a>, names: &[&'static str], data: &'a [u8]) -> Self {
        let few = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        let offsets = (0..).step_by(4);
        let (datatype, count) = (PointField::FLOAT32, 1);
        let field = |(name, offset): (&&'static str, u32)| PointField {
            name: (*name).into(),
            offset,
            datatype,
            count,
        };
        let point_step = names.len().saturating_mul(4);
        Self {
            header,
            height: 1,
            width: few(data.len().checked_div(point_step).unwrap_or(0)),
            fields: names.iter().zip(offsets).map(field).collect(),
            is_bigendian: false,
            point_step: few(point_step),
            row_step: few(data.len()),
            data,
            is_dense: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use re_cdr::{LittleEndian, from_bytes, to_vec};

    #[test]
    fn what_is_written_is_read_again() {
        let header = Header { stamp: Time::from_nanos(-1_500_000_000), frame_id: "world".into() };
        assert_eq!(header.stamp.nanos(), -1_500_000_000);
        let fields =
            vec![PointField { name: "x".into(), offset: 0, datatype: PointField::FLOAT32, count: 1 }];
        let cloud = PointCloud {
            header: header.clone(),
            height: 1,
            width: 2,
            fields,
            is_bigendian: false,
            point_step: 4,
            row_step: 8,
            data: &[1, 2, 3, 4, 5, 6, 7, 8],
            is_dense: true,
        };
        let bytes = to_vec::<_, LittleEndian>(&cloud).unwrap();
        assert_eq!(from_bytes::<PointCloud<'_>, LittleEndian>(&bytes).unwrap().0, cloud);
        let pose = RosPose { position: [1.0, 2.0, 3.0], orientation_xyzw: [0.0, 0.0, 0.0, 1.0] };
        let path = Path { header: header.clone(), poses: vec![PoseStamped { header, pose }] };
        let bytes = to_vec::<_, LittleEndian>(&path).unwrap();
        assert_eq!(from_bytes::<Path<'_>, LittleEndian>(&bytes).unwrap().0, path);
    }
}
