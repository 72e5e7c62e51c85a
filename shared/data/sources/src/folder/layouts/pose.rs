//! Poses as 4x4 matrices, `world_from_camera`, row by row.

use super::files::{numbers, text, wrong};
use super::times::FrameTimes;
use crate::SourceError;
use nalgebra::{Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::path::Path;
use tessera_evaluation::Trajectory;
use tessera_geometry::Pose;

/// How far rows of a rotation may be from unit length and right angles: files hold six digits.
const MOST_SKEW: f64 = 0.01;

/// A pose from 16 numbers; `None`: they are not finite, which says that it is not known.
///
/// # Errors
/// Not 16 numbers, or no rotation.
pub(crate) fn from_matrix(m: &[f64], path: &Path) -> Result<Option<Pose>, SourceError> {
    let &[a, b, c, x, d, e, f, y, g, h, i, z, ..] = matrix(m, path)?;
    if m.iter().any(|value| !value.is_finite()) {
        return Ok(None);
    }
    let rotation = Matrix3::new(a, b, c, d, e, f, g, h, i);
    let skew = skew(&rotation);
    if !(skew <= MOST_SKEW && rotation.determinant() > 0.0) {
        return Err(wrong(
            path,
            "the upper left 3x3 numbers are no rotation, expected a camera-to-world matrix",
        ));
    }
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Ok(Some(Pose::from_parts(Translation3::new(x, y, z), rotation)))
}

/// The 16 numbers of a 4x4 matrix, row by row.
pub(super) fn matrix<'m>(m: &'m [f64], path: &Path) -> Result<&'m [f64; 16], SourceError> {
    m.try_into().map_err(|_| wrong(path, format!("{} numbers, expected the 16 of a 4x4 matrix", m.len())))
}

/// How far a matrix is from a rotation or a reflection.
fn skew(rotation: &Matrix3<f64>) -> f64 {
    (rotation * rotation.transpose() - Matrix3::identity()).amax()
}

/// A pose of a camera with y up and z backward, as of ARKit and of renderers, with y down and z forward.
pub(super) fn y_down(pose: &Pose) -> Pose {
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    Pose::from_parts(pose.translation, pose.rotation * half_turn)
}

/// Collects known poses by time; one that comes out of order is left out.
#[derive(Default)]
pub(super) struct Poses(Trajectory);

impl Poses {
    pub(super) fn push(&mut self, stamp_nanos: i64, pose: Option<Pose>) {
        if let Some(pose) = pose {
            // Only stamps that do not rise are refused.
            let _ = self.0.push(stamp_nanos, pose);
        }
    }

    /// The trajectory; `None` where there is not a single pose.
    pub(super) fn finish(self) -> Option<Trajectory> {
        (!self.0.is_empty()).then_some(self.0)
    }
}

/// One file a frame, `file(number)`, of 16 numbers; a frame without one has no pose.
pub(super) fn of_files(
    frame_numbers: impl Iterator<Item = u64>,
    times: &FrameTimes,
    file: impl Fn(u64) -> std::path::PathBuf,
) -> Result<Option<Trajectory>, SourceError> {
    let mut poses = Poses::default();
    for number in frame_numbers {
        let path = file(number);
        if let Some(stamp) = times.nanos(number).filter(|_| path.is_file()) {
            poses.push(stamp, from_matrix(&numbers(&text(&path)?, &path)?, &path)?);
        }
    }
    Ok(poses.finish())
}

/// A file with 16 numbers a line, line `k` for the `k`-th stamp.
pub(super) fn of_lines(path: &Path, stamps_nanos: &[i64]) -> Result<Option<Trajectory>, SourceError> {
    let mut poses = Poses::default();
    let all = text(path)?;
    let lines = all.lines().filter(|line| !line.trim().is_empty());
    for (line, stamp) in lines.zip(stamps_nanos) {
        poses.push(*stamp, from_matrix(&numbers(line, path)?, path)?);
    }
    Ok(poses.finish())
}

/// A `.log` of Redwood and Open3D: blocks of a line with three numbers and four lines of a matrix,
/// block `k` for the `k`-th stamp.
pub(super) fn of_log(path: &Path, stamps_nanos: &[i64]) -> Result<Option<Trajectory>, SourceError> {
    const BLOCK: usize = 3 + 16;
    let all = numbers(&text(path)?, path)?;
    let (blocks, rest) = all.as_chunks::<BLOCK>();
    if !rest.is_empty() {
        let reason = format!("{} numbers, expected blocks of 3 and 16 (index, then a 4x4 matrix)", all.len());
        return Err(wrong(path, reason));
    }
    let mut poses = Poses::default();
    for ([_, _, _, matrix @ ..], stamp) in blocks.iter().zip(stamps_nanos) {
        poses.push(*stamp, from_matrix(matrix, path)?);
    }
    Ok(poses.finish())
}
