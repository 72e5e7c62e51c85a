//! The unknowns of a camera as a vector.

use nalgebra::SVector;
use tessera_geometry::Camera;

/// How many unknowns a camera has.
pub const N_PARAMETERS: usize = 11;

/// A value for each [`Parameter`], in the order of [`Parameter::ALL`].
pub type Parameters = SVector<f64, N_PARAMETERS>;

/// One unknown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameter {
    /// Focal length along x, pixels.
    Fx,
    /// Focal length along y, pixels.
    Fy,
    /// Principal point, column.
    Cx,
    /// Principal point, row.
    Cy,
    /// Radial distortion, second order.
    K1,
    /// Radial distortion, fourth order.
    K2,
    /// Tangential distortion along y.
    P1,
    /// Tangential distortion along x.
    P2,
    /// Radial distortion, sixth order.
    K3,
    /// Readout time, seconds.
    Readout,
    /// Depth offset, metres.
    DepthOffset,
}

impl Parameter {
    /// All of them, in the order of a [`Parameters`] vector.
    pub const ALL: [Self; N_PARAMETERS] = [
        Self::Fx,
        Self::Fy,
        Self::Cx,
        Self::Cy,
        Self::K1,
        Self::K2,
        Self::P1,
        Self::P2,
        Self::K3,
        Self::Readout,
        Self::DepthOffset,
    ];

    /// The name, as in a camera file where it has a key of its own.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fx => "fx",
            Self::Fy => "fy",
            Self::Cx => "cx",
            Self::Cy => "cy",
            Self::K1 => "k1",
            Self::K2 => "k2",
            Self::P1 => "p1",
            Self::P2 => "p2",
            Self::K3 => "k3",
            Self::Readout => "readout_s",
            Self::DepthOffset => "depth_offset_m",
        }
    }

    /// The unit; empty for a pure number.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Fx | Self::Fy | Self::Cx | Self::Cy => "px",
            Self::K1 | Self::K2 | Self::P1 | Self::P2 | Self::K3 => "",
            Self::Readout => "s",
            Self::DepthOffset => "m",
        }
    }
}

/// The unknowns of a camera.
pub(crate) fn of_camera(camera: &Camera) -> Parameters {
    let [k1, k2, p1, p2, k3] = camera.distortion;
    Parameters::from([
        camera.fx,
        camera.fy,
        camera.cx,
        camera.cy,
        k1,
        k2,
        p1,
        p2,
        k3,
        camera.readout_s,
        camera.depth_offset_m,
    ])
}

/// `camera` with other values of the unknowns.
pub(crate) fn with_parameters(camera: &Camera, values: &Parameters) -> Camera {
    let &[[fx, fy, cx, cy, k1, k2, p1, p2, k3, readout_s, depth_offset_m]] = &values.data.0;
    let distortion = [k1, k2, p1, p2, k3];
    Camera { fx, fy, cx, cy, distortion, readout_s, depth_offset_m, ..camera.clone() }
}
