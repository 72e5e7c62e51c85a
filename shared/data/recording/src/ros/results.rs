//! Messages of what a run finds: odometry with covariance, and diagnostics.

use super::structs::{Header, RosPose};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Covariance, row by row: translation before rotation, metres and radians, about the fixed axes of
/// the header's frame (of a twist: those of the child frame).
pub type Covariance = [[f64; 6]; 6];

/// `geometry_msgs/msg/PoseWithCovariance`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovariance {
    /// The pose.
    pub pose: RosPose,
    /// Its covariance.
    pub covariance: Covariance,
}

/// `geometry_msgs/msg/PoseWithCovarianceStamped`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseWithCovarianceStamped<'a> {
    /// Time and frame.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// The pose in the header's frame.
    pub pose: PoseWithCovariance,
}

/// `geometry_msgs/msg/TwistWithCovariance`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TwistWithCovariance {
    /// Velocity, metres per second.
    pub linear: [f64; 3],
    /// Angular velocity, radians per second.
    pub angular: [f64; 3],
    /// Its covariance.
    pub covariance: Covariance,
}

/// `nav_msgs/msg/Odometry`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Odometry<'a> {
    /// Time and frame of the pose.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Frame of the twist.
    #[serde(borrow)]
    pub child_frame_id: Cow<'a, str>,
    /// Pose of the child frame in the header's frame.
    pub pose: PoseWithCovariance,
    /// Velocity in the child frame.
    pub twist: TwistWithCovariance,
}

/// `diagnostic_msgs/msg/KeyValue`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct KeyValue<'a> {
    /// What.
    #[serde(borrow)]
    pub key: Cow<'a, str>,
    /// Its value.
    #[serde(borrow)]
    pub value: Cow<'a, str>,
}

/// `diagnostic_msgs/msg/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticStatus<'a> {
    /// One of the levels below.
    pub level: u8,
    /// Component.
    #[serde(borrow)]
    pub name: Cow<'a, str>,
    /// Its state in words.
    #[serde(borrow)]
    pub message: Cow<'a, str>,
    /// Hardware; may be empty.
    #[serde(borrow)]
    pub hardware_id: Cow<'a, str>,
    /// Numbers.
    #[serde(borrow)]
    pub values: Vec<KeyValue<'a>>,
}

impl DiagnosticStatus<'_> {
    /// Level of a component that works.
    pub const OK: u8 = 0;
    /// Level of one that works with less.
    pub const WARN: u8 = 1;
    /// Level of one that does not work.
    pub const ERROR: u8 = 2;
    /// Level of one that nothing is heard of.
    pub const STALE: u8 = 3;
}

/// `diagnostic_msgs/msg/DiagnosticArray`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DiagnosticArray<'a> {
    /// Time.
    #[serde(borrow)]
    pub header: Header<'a>,
    /// Components.
    #[serde(borrow)]
    pub status: Vec<DiagnosticStatus<'a>>,
}
