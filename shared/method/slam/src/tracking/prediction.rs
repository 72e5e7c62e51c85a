//! Start of an alignment: the predicted pose of a frame, and the surfaces it is aligned to.

use crate::estimation::motion_filter::MotionPrior;
use crate::pairs::weighted_pair::WeightedPair;
use tessera_features::Feature;
use tessera_geometry::{Pose, Twist};
use tessera_registration::ShutterTable;
use tessera_surface::SurfaceView;

/// A fixed surface with its pose.
pub(crate) struct Reference<'a> {
    pub(crate) world_from_camera: Pose,
    /// Names its surface among the recent frames or, with `true`, among the keyframes.
    pub(crate) key: (bool, u64),
    pub(crate) surface: SurfaceView<'a>,
    /// The run whose camera saw it, of a keyframe; `None`: that of the frame.
    pub(crate) session: Option<u32>,
    pub(crate) shutter: ShutterTable,
    /// Its own motion per second in its camera frame.
    pub(crate) velocity: Twist,
    pub(crate) features: &'a [Feature],
    /// Features that it shares with the frame.
    pub(crate) pair: Option<WeightedPair>,
}

/// The initial guess of a new frame's pose, and how it got there.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prediction {
    pub(crate) world_from_camera: Pose,
    /// The frame before, and the seconds since: the rolling shutter's velocity comes from both.
    pub(crate) previous: Option<(Pose, f64)>,
    /// Whether a motion is known that leads here: without one it is the last pose, and a guess.
    pub(crate) is_known: bool,
    /// Velocity until an alignment gives a better one.
    pub(crate) velocity: Twist,
    /// Standard deviation of the rotation about each axis where a gyroscope measured it, radians.
    pub(crate) rotation_sigma_rad: Option<f64>,
    /// Predicted pose by the motion so far, with its variance: a measurement beside the surfaces.
    pub(crate) motion: Option<MotionPrior>,
    /// First distance limit, metres.
    pub(crate) first_distance_m: f64,
    pub(crate) outer_iterations: u32,
}
