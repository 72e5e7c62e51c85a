//! A small run by hand: six frames, three keyframes, one correction, one drop.

use crate::replay::Replay;
use tessera_geometry::{Camera, Pose, PoseBits};
use tessera_slam::{
    AlignRecord, AppliedCorrection, Cause, Correction, EdgeRecord, FrameRecord, KeyframePose, KeyframeRecord,
    LoopRecord, LoopVerdict, MapChange, PoseRecord, SkippedFrames, State, Submaps,
};
use tessera_surface::Vertex;

fn along_x(x: f64) -> PoseBits {
    PoseBits::from(&Pose::translation(x, 0.0, 0.0))
}

fn stamp_nanos(index: u64) -> i64 {
    100_000_000_000 + index as i64 * 33_333_000
}

fn keyframe(id: u32, frame_index: u64, x: f64, edges: Vec<EdgeRecord>) -> Option<KeyframeRecord> {
    // Only keyframe 1 moves while it is exposed.
    let velocity = if id == 1 { [0.0, 1.0, 0.0, 0.0, 0.0, 0.0] } else { [0.0; 6] };
    let frame = (frame_index, stamp_nanos(frame_index));
    Some(KeyframeRecord { velocity, edges, ..KeyframeRecord::new(id, frame, along_x(x), Vec::new()) })
}

fn frame(index: u64, anchored_to: (u32, f64), new_keyframe: Option<KeyframeRecord>) -> AlignRecord {
    let x = index as f64 / 10.0;
    AlignRecord::Frame(Box::new(FrameRecord {
        index,
        stamp_nanos: stamp_nanos(index),
        state: if index == 4 { State::Lost } else { State::Tracking },
        causes: if index == 4 { vec![Cause::FewMatches { share: 0.006, least: 0.15 }] } else { Vec::new() },
        pose: PoseRecord {
            world_from_camera: along_x(x),
            keyframe: anchored_to.0,
            keyframe_from_camera: along_x(anchored_to.1),
            covariance: if index == 4 { covariance() } else { Vec::new() },
            n_correspondences: if index == 4 { 12 } else { 0 },
            entropy_nats: 0.0,
            ..PoseRecord::default()
        },
        change: MapChange { new_keyframe, ..MapChange::default() },
        ..FrameRecord::default()
    }))
}

/// Standard deviations of 0.01, 0.02, … 0.06 and no correlation.
fn covariance() -> Vec<f64> {
    let mut triangle = vec![0.0; 21];
    for (axis, position) in [0, 6, 11, 15, 18, 20].into_iter().enumerate() {
        triangle[position] = (0.01 * (axis + 1) as f64).powi(2);
    }
    triangle
}

/// A loop from keyframe 2 to an older one.
fn loop_pair(older: u32, weight: f64) -> LoopRecord {
    LoopRecord {
        newer: 2,
        older,
        overlap: 0.6,
        in_front: 0.0,
        inconsistency_sigmas: 0.5,
        residual_sigmas: 0.5,
        weight,
        verdict: LoopVerdict::Accepted,
    }
}

/// The journal: keyframes at frames 0, 2 and 4, a correction that moves keyframe 1 by 1 m and
/// solves frame 5 again, one loop kept and one refused, and frame 6 dropped.
pub fn records() -> Vec<AlignRecord> {
    let correction = Correction {
        request: 0,
        input_hash: 0,
        keyframes: vec![
            KeyframePose { id: 0, world_from_camera: along_x(0.0) },
            KeyframePose { id: 1, world_from_camera: along_x(1.2) },
        ],
        frames: vec![(5, along_x(7.0))],
        loops: vec![loop_pair(0, 0.9), loop_pair(1, 0.1)],
        submaps: Submaps::default(),
        outer_iterations: 4,
        n_graduated_rounds: 0,
        refinement: None,
    };
    let edge = |to, is_loop| EdgeRecord { to, is_loop };
    vec![
        frame(0, (0, 0.0), keyframe(0, 0, 0.0, vec![])),
        frame(1, (0, 0.1), None),
        frame(2, (0, 0.2), None),
        frame(3, (1, 0.1), keyframe(1, 2, 0.2, vec![edge(0, false)])),
        frame(4, (1, 0.2), None),
        frame(5, (2, 0.1), keyframe(2, 4, 0.4, vec![edge(0, true), edge(1, true)])),
        AlignRecord::Correction(Box::new(AppliedCorrection { before_frame: 6, correction })),
        AlignRecord::Skipped(SkippedFrames { frames: 6..7, reason: "newer frames had come".into() }),
        AlignRecord::End { n_frames: 7, request: None },
    ]
}

/// The journal, folded.
pub fn replay() -> Replay {
    let mut replay = Replay::default();
    records().into_iter().for_each(|record| replay.apply(record));
    replay
}

/// A camera with a rolling shutter of 30 ms.
pub fn camera() -> Camera {
    Camera { readout_s: 0.03, ..Camera::pinhole((640, 480), [525.0, 525.0, 319.5, 239.5], 5000.0) }
}

/// A surface with one vertex of use, in the first row.
pub fn surface(_keyframe: usize) -> Vec<Vertex> {
    let mut vertices = vec![Vertex::default(); 160 * 120];
    let vertex = |z, flags| Vertex {
        position: [0.0, 0.0, z],
        flags_rgb: Vertex::pack(flags, 0, [1, 2, 3]),
        normal: [0.0, 0.0, -1.0],
        reserved: 0,
    };
    vertices[0] = vertex(2.0, Vertex::VALID);
    vertices[1] = vertex(2.1, 0);
    vertices[2] = vertex(20.0, Vertex::VALID);
    vertices
}
