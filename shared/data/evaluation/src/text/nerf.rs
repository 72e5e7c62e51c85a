//! `transforms.json` of nerfstudio with times, as an export writes it.

use crate::text::file::{ReadError, Trajectory, of_matrix};
use nalgebra::Matrix3;
use serde::Deserialize;
use std::path::Path;
use tessera_geometry::Pose;

/// Seconds that fit nanoseconds in 64 bits.
const MOST_SECONDS: f64 = 9e9;

#[derive(Deserialize)]
struct TimedTransforms {
    frames: Vec<TimedTransform>,
}

#[derive(Deserialize)]
struct TimedTransform {
    #[serde(default)]
    file_path: String,
    timestamp: Option<f64>,
    transform_matrix: [[f64; 4]; 4],
}

/// The poses of a file by their times; `None`: it is no such file.
///
/// # Errors
/// Names the frame that has no time, or no rotation.
pub(crate) fn parse(text: &str, path: &Path) -> Result<Option<Trajectory>, ReadError> {
    if !text.trim_start().starts_with('{') || !text.contains("transform_matrix") {
        return Ok(None);
    }
    let wrong = |found: String, expected| ReadError::Row { path: path.to_owned(), line: 1, found, expected };
    let transforms: TimedTransforms = serde_json::from_str(text)
        .map_err(|error| wrong(error.to_string(), "frames with file_path, timestamp and transform_matrix"))?;
    let mut rows = Vec::new();
    for frame in transforms.frames {
        let seconds = frame.timestamp.filter(|seconds| seconds.abs() < MOST_SECONDS);
        let Some(seconds) = seconds else {
            return Err(wrong(frame.file_path, "a timestamp in seconds for each frame"));
        };
        let Some(pose) = pose(&frame.transform_matrix) else {
            return Err(wrong(frame.file_path, "a transform_matrix of a rotation"));
        };
        rows.push((nanos(seconds), pose));
    }
    rows.sort_by_key(|(stamp, _)| *stamp);
    let mut trajectory = Trajectory::default();
    for (stamp, pose) in rows {
        let line = |source| ReadError::Line { path: path.to_owned(), line: 1, source };
        trajectory.push(stamp, pose).map_err(line)?;
    }
    Ok(Some(trajectory))
}

#[expect(clippy::cast_possible_truncation, reason = "seconds whose nanoseconds fit")]
fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

/// `world_from_camera` with y down and z forward, of a matrix with y up and z backward.
fn pose(&[a, b, c, _]: &[[f64; 4]; 4]) -> Option<Pose> {
    let ([a, d, g, x], [b, e, h, y], [c, f, i, z]) = (a, b, c);
    of_matrix(Matrix3::new(a, -d, -g, b, -e, -h, c, -f, -i), [x, y, z])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_poses_by_their_times() {
        let frame = |seconds: &str, x: f64| {
            format!(
                r#"{{"file_path": "a.png", {seconds} "transform_matrix": [[1, 0, 0, {x}], [0, -1, 0, 2], [0, 0, -1, 3], [0, 0, 0, 1]]}}"#
            )
        };
        let file = |frames: &[String]| format!(r#"{{"fl_x": 1, "frames": [{}]}}"#, frames.join(", "));
        let read = |text: &str| parse(text, Path::new("t.json")).map_err(|error| error.to_string());
        let text = file(&[frame(r#""timestamp": 1.5,"#, 7.0), frame(r#""timestamp": 0.25,"#, 4.0)]);
        let found = read(&text).unwrap().unwrap();
        assert_eq!(found.stamps_nanos, [250_000_000, 1_500_000_000]);
        assert!(found.poses[1].rotation.angle() < 1e-12);
        assert_eq!(found.poses[1].translation.vector, nalgebra::Vector3::new(7.0, 2.0, 3.0));
        let message = read(&file(&[frame("", 0.0)])).unwrap_err();
        assert!(message.contains("expected a timestamp in seconds for each frame"), "{message}");
        assert_eq!(read("{\"a\": 1}"), Ok(None));
    }
}
