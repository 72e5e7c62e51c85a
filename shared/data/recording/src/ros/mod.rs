//! Messages of ROS 2: one set of structs for reading and writing, and the texts that define them.
//!
//! Fields stand in the order of the interface definitions; CDR is that order.

mod definitions;
mod read;
mod structs;

pub use definitions::{CLOUD, Definition, PATH, POSE, TRANSFORMS};
pub(crate) use read::{STAMP_BYTES, camera, compressed, image, stamp_nanos};
pub use structs::{
    CameraInfo, CompressedImage, Header, Image, Path, PointCloud, PointField, PoseMessage, PoseStamped, Time,
    TransformStamped, Transforms,
};
