//! Messages of ROS 2: one set of structs for reading and writing, and the texts that define them.
//!
//! Fields stand in the order of the interface definitions; CDR is that order.

mod definitions;
mod read;
mod results;
mod structs;
mod write;

pub use definitions::{CLOUD, Definition, PATH, POSE, TRANSFORMS};
pub(crate) use read::{
    BIG_ENDIAN, STAMP_BYTES, camera, compressed, extrinsics, image, imu, stamp_nanos, transforms,
};
pub use read::{decode, decode_whole};
pub use results::{
    Covariance, DiagnosticArray, DiagnosticStatus, KeyValue, Odometry, PoseWithCovariance,
    PoseWithCovarianceStamped, TwistWithCovariance,
};
pub use structs::{
    CameraInfo, CompressedImage, Extrinsics, Header, Image, Imu, Path, PointCloud, PointField, PoseStamped,
    RegionOfInterest, RosPose, Time, TransformStamped, Transforms,
};
pub use write::encode;
