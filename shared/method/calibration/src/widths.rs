//! Prior of the camera's parameters: standard deviations about the initial camera.

use crate::parameters::{Parameter, Parameters};
use crate::system::CameraMatrix;

/// Share of the common width that a lens's tangential terms have: they come from a tilted lens.
const TANGENTIAL_SHARE: f64 = 0.125;
/// Share of the common width by which the focal lengths may differ from their ratio at the start:
/// pixels are nearly square, and how nearly is known.
const ASPECT_SHARE: f64 = 0.125;
const FX: usize = 0;
const FY: usize = 1;

/// Independent unit steps: parameters are `to_parameters * u`, and each `u` is of the order of one.
#[derive(Clone, Debug)]
pub(crate) struct Widths {
    /// One column for each unit step.
    pub(crate) to_parameters: CameraMatrix,
    /// Back; zero for parameters that do not take part.
    pub(crate) from_parameters: CameraMatrix,
}

impl Widths {
    /// `sizes`: what moves the image by one pixel, 0 for parameters that do not take part; `px`: how
    /// many pixels a start may be off.
    pub(crate) fn new(sizes: &Parameters, px: f64) -> Self {
        let mut widths = sizes * px;
        for (width, parameter) in widths.iter_mut().zip(&Parameter::ALL) {
            if matches!(parameter, Parameter::P1 | Parameter::P2) {
                *width *= TANGENTIAL_SHARE;
            }
        }
        let inverse = widths.map(|width| if width > 0.0 { 1.0 / width } else { 0.0 });
        let mut to_parameters = CameraMatrix::from_diagonal(&widths);
        let mut from_parameters = CameraMatrix::from_diagonal(&inverse);
        if widths[FX] > 0.0 && widths[FY] > 0.0 {
            // One step for both focal lengths, one for what sets them apart.
            let [x, y] = [widths[FX], widths[FY]];
            for (row, width, sign) in [(FX, x, 1.0), (FY, y, -1.0)] {
                to_parameters[(row, FX)] = width;
                to_parameters[(row, FY)] = sign * ASPECT_SHARE * width;
            }
            from_parameters[(FX, FX)] = 0.5 / x;
            from_parameters[(FX, FY)] = 0.5 / y;
            from_parameters[(FY, FX)] = 0.5 / (ASPECT_SHARE * x);
            from_parameters[(FY, FY)] = -0.5 / (ASPECT_SHARE * y);
        }
        Self { to_parameters, from_parameters }
    }
}
