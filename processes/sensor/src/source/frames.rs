//! Frames of a source, decoded in place in shared memory, several at a time.

use super::broken::Broken;
use crate::frame::{PreparedFrame, blank_frame};
use rayon::prelude::*;
use tessera_messages::{FrameHeader, FrameShape, Kind};
use tessera_sources::{FrameBuffers, FrameInfo, Source, SourceError};
use tessera_stage::{Pulse, StageContext, StageError, monotonic_nanos};
use tessera_transport::{SlicePublisher, TransportError};

/// The source as the sensor uses it.
pub(super) struct Frames<'a> {
    source: &'a dyn Source,
    shape: FrameShape,
    /// Frames there are; `u64::MAX`: no end in sight.
    pub(super) n_frames: u64,
    /// Frames decoded before the first was sent (`--preload`), by index.
    preloaded: Vec<(FrameInfo, Vec<u16>)>,
    broken: Broken,
}

/// Frames decoded between two signs of life while preloading.
const PRELOAD_BATCH: u64 = 16;

impl<'a> Frames<'a> {
    pub(super) fn new(source: &'a dyn Source, context: &StageContext) -> Self {
        let n_frames = context.run.n_frames.or(source.n_frames()).unwrap_or(u64::MAX);
        let broken = Broken::new(context, n_frames);
        Self { source, shape: context.layout.frame, n_frames, preloaded: Vec::new(), broken }
    }

    /// Decodes every frame into memory, so that what follows is as fast as the other stages.
    ///
    /// The first frame that cannot be read ends it; reading that one again will say why.
    pub(super) fn preload(&mut self, pulse: &mut Pulse) {
        let mut next = 0;
        while next < self.n_frames {
            pulse.working(next);
            let batch: Vec<_> = (next..self.n_frames.min(next + PRELOAD_BATCH))
                .into_par_iter()
                .map(|index| {
                    let mut payload = vec![0; self.shape.payload_len()];
                    self.read(index, &mut payload).map(|info| (info, payload))
                })
                .collect();
            for frame in batch {
                let Ok(frame) = frame else { return };
                self.preloaded.push(frame);
                next += 1;
            }
            pulse.progress();
        }
    }

    /// Before the first frame that a life of the sensor reads, and where reading begins anew.
    pub(super) fn go_to(&self, index: u64, pulse: &mut Pulse) {
        self.source.go_to(index, &mut || pulse.progress());
    }

    /// Sensor time of a frame.
    pub(super) fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.source.stamp_nanos(index)
    }

    /// Reads frames straight into shared memory, in parallel; the first that cannot be read ends
    /// the answer.
    pub(super) fn prepare(
        &self,
        indices: std::ops::Range<u64>,
        publisher: &SlicePublisher<FrameHeader, u16>,
    ) -> Result<(Vec<PreparedFrame>, Option<StageError>), TransportError> {
        let mut prepared = Vec::new();
        for index in indices {
            prepared.push(blank_frame(index, Kind::Frame, self.shape, publisher)?);
        }
        let mut jobs: Vec<(u64, &mut [u16])> =
            prepared.iter_mut().map(|frame| (frame.index, frame.loan.payload_mut())).collect();
        let read: Vec<(Result<FrameInfo, StageError>, u64)> = jobs
            .par_iter_mut()
            .map(|(index, payload)| {
                let began = monotonic_nanos();
                let info = self.read(*index, payload);
                (info, monotonic_nanos().saturating_sub(began))
            })
            .collect();
        let mut error = None;
        for (frame, (info, nanos)) in prepared.iter_mut().zip(read) {
            frame.decode_nanos = nanos;
            match info {
                Ok(info) => {
                    let header = frame.loan.header_mut();
                    header.stamp_nanos = info.stamp_nanos;
                    header.has_colour = info.has_colour.into();
                    header.rotation = info.rotation.into();
                    header.up = info.up.into();
                }
                Err(problem) => {
                    error = Some((frame.index, problem));
                    break;
                }
            }
        }
        if let Some((bad, problem)) = error {
            prepared.retain(|frame| frame.index < bad);
            return Ok((prepared, Some(problem)));
        }
        Ok((prepared, None))
    }

    fn read(&self, index: u64, payload: &mut [u16]) -> Result<FrameInfo, StageError> {
        let preloaded = usize::try_from(index).ok().and_then(|index| self.preloaded.get(index));
        if let Some((info, bytes)) = preloaded
            && bytes.len() == payload.len()
        {
            payload.copy_from_slice(bytes);
            return Ok(*info);
        }
        let Some((depth, colour)) = self.shape.split_mut(payload) else {
            return Err(StageError::Inconsistent(format!("frame {index}: a loan is too short")));
        };
        let mut buffers = FrameBuffers { depth, colour };
        let input = |error: SourceError| StageError::Input(error.to_string());
        if !self.broken.is_borne() {
            return self.source.read(index, &mut buffers).map_err(input);
        }
        let (info, problem) = self.source.read_what_is_there(index, &mut buffers).map_err(input)?;
        if let Some(problem) = problem {
            self.broken.note(index, &problem.to_string(), matches!(problem, SourceError::Colour(_)))?;
        }
        Ok(info)
    }
}
