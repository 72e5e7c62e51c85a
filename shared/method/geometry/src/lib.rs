//! Poses, tangent vectors, the camera model and the sensor's noise.
//!
//! # Conventions, stated here and nowhere else
//!
//! * Camera axes: x right, y down, z forward; the viewpoint is the origin.
//! * A pose reads as a chain: `world_from_camera` maps points in the camera
//!   frame to points in the world. Neighbours match, inverses swap.
//! * A tangent vector ([`Twist`]) is `(rho, phi)`: translation first, metres and radians.
//! * An update multiplies on the right: `world_from_camera * exp(delta)`.
//! * Quaternions are written `x y z w` in files and in [`PoseBits`].
//! * Pixels are `(row, column)`; the centre of the first pixel is `(0, 0)`.
//! * Poses are `f64`, points of a surface are `f32`, sums over points are `f64`.
#![forbid(unsafe_code)]

mod camera;
mod inertial;
mod noise;
mod pose;
mod rays;
mod shutter;
mod symmetric;
mod up;

pub use camera::{Camera, CameraError};
pub use inertial::{InertialRotation, RelativeRotation};
pub use noise::DepthNoise;
pub use pose::{
    Matrix6, Pose, PoseBits, Twist, Vector6, adjoint, compose_normalised, exp, hat, log, rotation_exp,
    rotation_log, translation_rotation_norms,
};
pub use rays::RayTable;
pub use shutter::RollingShutter;
pub use symmetric::{from_upper_triangle, upper_triangle};
pub use up::UpDirection;
