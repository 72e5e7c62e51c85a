//! The trajectory: as published, in pieces as it grows; with all corrections, once at the end.

use crate::error::ViewError;
use crate::map::Map;
use crate::scene::{BLUE, GREEN, colour, log, place};
use re_sdk::RecordingStream;
use re_sdk_types::archetypes::LineStrips3D;
use std::collections::BTreeMap;
use tessera_geometry::{Pose, PoseBits};
use tessera_mapping::{AlignRecord, FrameRecord};

/// Frames of a piece: what is logged again while it grows.
const PIECE: usize = 60;
/// Radius of the line, metres.
const LINE_M: f32 = 0.004;

/// All frames so far.
#[derive(Default)]
pub(crate) struct Track {
    /// Pieces that are whole.
    n_pieces: usize,
    /// Places of the piece that grows; it begins where the one before ended.
    piece: Vec<[f32; 3]>,
    has_grown: bool,
    /// Frame index, keyframe that it hangs on, and its pose in that keyframe.
    frames: Vec<(u64, u32, PoseBits)>,
    /// Frames that an optimisation solved again.
    solved: BTreeMap<u64, PoseBits>,
}

impl Track {
    /// Takes the next record in.
    pub(crate) fn apply(&mut self, record: &AlignRecord) {
        match record {
            AlignRecord::Frame(frame) => self.add(frame),
            AlignRecord::Correction(applied) => self.solved.extend(applied.correction.frames.iter().copied()),
            _ => {}
        }
    }

    fn add(&mut self, frame: &FrameRecord) {
        self.piece.push(place(&Pose::from(&frame.world_from_camera)));
        self.has_grown = true;
        self.frames.push((frame.index, frame.keyframe, frame.keyframe_from_camera));
    }

    /// Logs what has been added since the last time.
    pub(crate) fn log(&mut self, recording: &RecordingStream) -> Result<(), ViewError> {
        if !std::mem::take(&mut self.has_grown) {
            return Ok(());
        }
        while self.piece.len() > PIECE {
            let whole: Vec<[f32; 3]> = self.piece[..=PIECE].to_vec();
            self.piece.drain(..PIECE);
            log(recording, &format!("world/trajectory/online/{}", self.n_pieces), &line(whole, BLUE))?;
            self.n_pieces += 1;
        }
        let path = format!("world/trajectory/online/{}", self.n_pieces);
        log(recording, &path, &line(self.piece.clone(), BLUE))
    }

    /// Logs the trajectory with all corrections.
    pub(crate) fn log_final(&self, recording: &RecordingStream, map: &Map) -> Result<(), ViewError> {
        let of = |(index, keyframe, keyframe_from_camera): &(u64, u32, PoseBits)| {
            let solved = self.solved.get(index).map(Pose::from);
            solved.or_else(|| Some(map.pose(*keyframe)? * Pose::from(keyframe_from_camera)))
        };
        let places: Vec<[f32; 3]> = self.frames.iter().filter_map(of).map(|pose| place(&pose)).collect();
        log(recording, "world/trajectory/final", &line(places, GREEN))
    }
}

fn line(places: Vec<[f32; 3]>, of: [u8; 3]) -> LineStrips3D {
    LineStrips3D::new([places]).with_colors([colour(of)]).with_radii([LINE_M])
}
