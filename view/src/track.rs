//! The trajectory: as published, in pieces as it grows; with all corrections, once at the end.

use crate::error::ViewError;
use crate::scene::{BLUE, GREEN, colour, log, place};
use re_sdk::RecordingStream;
use re_sdk_types::archetypes::LineStrips3D;
use tessera_geometry::Pose;
use tessera_slam::{AlignRecord, FramePose, FrameRecord, PoseHistory};

/// Frames of a piece: what is logged again while it grows.
const PIECE: usize = 60;
/// Radius of the line, metres.
const LINE_M: f32 = 0.004;

/// All frames so far.
#[derive(Default)]
pub(crate) struct DrawnTrack {
    /// Pieces that are whole.
    n_pieces: usize,
    /// Places of the piece that grows; it begins where the one before ended.
    piece: Vec<[f32; 3]>,
    has_grown: bool,
    /// What the final pose of each frame follows from.
    frames: Vec<FramePose>,
}

impl DrawnTrack {
    /// Takes the next record in.
    pub(crate) fn apply(&mut self, record: &AlignRecord) {
        if let AlignRecord::Frame(frame) = record {
            self.add(frame);
        }
    }

    fn add(&mut self, frame: &FrameRecord) {
        self.piece.push(place(&Pose::from(&frame.pose.world_from_camera)));
        self.has_grown = true;
        self.frames.push(frame.into());
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
    pub(crate) fn log_final(
        &self,
        recording: &RecordingStream,
        poses: &PoseHistory,
    ) -> Result<(), ViewError> {
        let final_place = |frame: &FramePose| place(&poses.final_pose(frame));
        let places: Vec<[f32; 3]> = self.frames.iter().map(final_place).collect();
        log(recording, "world/trajectory/final", &line(places, GREEN))
    }
}

fn line(places: Vec<[f32; 3]>, of: [u8; 3]) -> LineStrips3D {
    LineStrips3D::new([places]).with_colors([colour(of)]).with_radii([LINE_M])
}
