//! Frames prepared in shared memory: decoded in place, several at a time.

use rayon::prelude::*;
use tessera_messages::{FrameHeader, FrameShape, Kind};
use tessera_sources::{FrameBuffers, FrameInfo, Source};
use tessera_stage::{Context, Delivery, KillPoints, Pulse, StageError, monotonic_nanos};
use tessera_transport::{Loan, SlicePublisher, TransportError};

/// A frame in shared memory that has not been sent.
pub(crate) struct Prepared {
    pub(crate) index: u64,
    pub(crate) loan: Loan<FrameHeader, u16>,
    /// Time that reading it took.
    pub(crate) decode_nanos: u64,
}

/// Whether the frame is to be sent; a test may want it lost, or full of nonsense.
pub(crate) fn deliver(kill_points: &KillPoints, frame: &mut Prepared) -> bool {
    let delivery = kill_points.deliver("read", frame.index);
    if delivery == Delivery::Corrupt {
        let header = frame.loan.header_mut();
        match frame.index % 3 {
            0 => header.width ^= 1,
            1 => header.kind = u32::MAX,
            _ => header.index = u64::MAX,
        }
    }
    delivery != Delivery::Dropped
}

/// The source as the sensor uses it.
pub(crate) struct Frames<'a> {
    source: &'a dyn Source,
    shape: FrameShape,
    /// Frames there are; `u64::MAX`: no end in sight.
    pub(crate) n_frames: u64,
    /// Frames decoded before the first was sent (`--preload`), by index.
    preloaded: Vec<(FrameInfo, Vec<u16>)>,
}

/// Frames decoded between two signs of life while preloading.
const PRELOAD_BATCH: u64 = 16;

impl<'a> Frames<'a> {
    pub(crate) fn new(source: &'a dyn Source, context: &Context) -> Self {
        let n_frames = context.run.n_frames.or(source.n_frames()).unwrap_or(u64::MAX);
        Self { source, shape: context.layout.frame, n_frames, preloaded: Vec::new() }
    }

    /// Decodes every frame into memory, so that what follows is as fast as the other stages.
    ///
    /// The first frame that cannot be read ends it; reading that one again will say why.
    pub(crate) fn preload(&mut self, pulse: &mut Pulse) {
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

    /// Sensor time of a frame.
    pub(crate) fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.source.stamp_nanos(index)
    }

    /// Reads frames straight into shared memory, in parallel; the first that cannot be read ends
    /// the answer.
    pub(crate) fn prepare(
        &self,
        indices: std::ops::Range<u64>,
        publisher: &SlicePublisher<FrameHeader, u16>,
    ) -> Result<(Vec<Prepared>, Option<StageError>), TransportError> {
        let mut prepared = Vec::new();
        for index in indices {
            let mut loan = publisher.loan(self.shape.payload_len())?;
            *loan.header_mut() = self.header(index, Kind::Frame);
            prepared.push(Prepared { index, loan, decode_nanos: 0 });
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

    /// The message that says that the source is exhausted.
    pub(crate) fn end(
        &self,
        publisher: &SlicePublisher<FrameHeader, u16>,
    ) -> Result<Prepared, TransportError> {
        let mut loan = publisher.loan(self.shape.payload_len())?;
        *loan.header_mut() = self.header(self.n_frames, Kind::End);
        Ok(Prepared { index: self.n_frames, loan, decode_nanos: 0 })
    }

    fn header(&self, index: u64, kind: Kind) -> FrameHeader {
        let mut header = FrameHeader {
            index,
            width: self.shape.width,
            height: self.shape.height,
            kind: kind.to_wire(),
            ..FrameHeader::default()
        };
        header.times.read_began = monotonic_nanos();
        header
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
        self.source
            .read(index, &mut FrameBuffers { depth, colour })
            .map_err(|e| StageError::Input(e.to_string()))
    }
}
