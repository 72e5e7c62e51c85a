//! What crosses the border of Python: columns of numbers as bytes, little-endian.

use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyTuple};
use tessera_geometry::{Pose, PoseBits};
use tessera_offline::{FrameRecord, State};
use tessera_outputs::{PlyVertex, Replay};

/// State of a frame in one word.
pub(crate) fn state_name(state: State, is_degenerate: bool) -> &'static str {
    match state {
        State::Tracking if is_degenerate => "degenerate",
        State::Tracking => "tracking",
        State::Lost => "lost",
        State::Relocalising => "relocalising",
    }
}

/// A pose as a 4x4 matrix, row by row.
pub(crate) fn matrix(pose: &Pose) -> [f64; 16] {
    let matrix = pose.to_homogeneous();
    std::array::from_fn(|at| matrix[(at / 4, at % 4)])
}

/// Poses in the order of time.
#[derive(Default)]
pub(crate) struct PoseColumns {
    /// Indices of frames, 64 bits.
    indices: Vec<u8>,
    /// Nanoseconds, 64 bits.
    stamps: Vec<u8>,
    states: Vec<&'static str>,
    /// `tx ty tz qx qy qz qw`, seven 64-bit floats a pose.
    poses: Vec<u8>,
    /// Sixteen 64-bit floats a pose.
    matrices: Vec<u8>,
}

impl PoseColumns {
    /// Every frame of the main component with all corrections: the rows of `trajectory.txt`.
    pub(crate) fn of_frames(replay: &Replay) -> Self {
        let main = replay.main_component();
        let mut rows = Self::default();
        for frame in replay.frames.iter().filter(|frame| replay.component(frame) == main) {
            rows.push(frame.index, frame.stamp_nanos, state_of(frame), &replay.final_pose(frame));
        }
        rows
    }

    /// Every keyframe of this run in the main component with all corrections: the rows of `keyframes.txt`.
    pub(crate) fn of_keyframes(replay: &Replay) -> Self {
        let mut rows = Self::default();
        let own = |id: u32| id as usize >= replay.n_map_keyframes;
        for (keyframe, pose) in replay.main_keyframes().filter(|(keyframe, _)| own(keyframe.id)) {
            let frame = replay.frames.binary_search_by_key(&keyframe.frame_index, |frame| frame.index);
            let state = frame.map_or("tracking", |at| state_of(&replay.frames[at]));
            rows.push(keyframe.frame_index, keyframe.stamp_nanos, state, &pose);
        }
        rows
    }

    fn push(&mut self, index: u64, stamp_nanos: i64, state: &'static str, pose: &Pose) {
        self.indices.extend(index.to_le_bytes());
        self.stamps.extend(stamp_nanos.to_le_bytes());
        self.states.push(state);
        let PoseBits { translation_m, rotation_xyzw } = PoseBits::from(pose);
        self.poses.extend(translation_m.into_iter().chain(rotation_xyzw).flat_map(f64::to_le_bytes));
        self.matrices.extend(matrix(pose).into_iter().flat_map(f64::to_le_bytes));
    }

    /// The columns: indices, stamps, states, poses, matrices.
    pub(crate) fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyTuple>> {
        let bytes = |column: &[u8]| PyBytes::new(py, column);
        (bytes(&self.indices), bytes(&self.stamps), self.states, bytes(&self.poses), bytes(&self.matrices))
            .into_pyobject(py)
    }
}

fn state_of(frame: &FrameRecord) -> &'static str {
    state_name(frame.state, frame.is_degenerate())
}

/// Points of a map.
pub(crate) struct Points {
    /// Metres, three 32-bit floats a point.
    positions: Vec<u8>,
    /// Unit vectors, three 32-bit floats a point.
    normals: Vec<u8>,
    /// Red, green, blue.
    colours: Vec<u8>,
}

impl Points {
    pub(crate) fn new(points: &[PlyVertex]) -> Self {
        Self {
            positions: points.iter().flat_map(|point| point.position).flat_map(f32::to_le_bytes).collect(),
            normals: points.iter().flat_map(|point| point.normal).flat_map(f32::to_le_bytes).collect(),
            colours: points.iter().flat_map(|point| point.rgb).collect(),
        }
    }

    /// The columns: positions, normals, colours.
    pub(crate) fn into_python(self, py: Python<'_>) -> PyResult<Bound<'_, PyTuple>> {
        let bytes = |column: &[u8]| PyBytes::new(py, column);
        (bytes(&self.positions), bytes(&self.normals), bytes(&self.colours)).into_pyobject(py)
    }
}
