//! Choice of the next frame: each in order, or in live mode the newest.
#![cfg_attr(
    not(test),
    deny(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        clippy::cast_possible_truncation,
        clippy::arithmetic_side_effects
    )
)]

use std::collections::BTreeSet;
use tessera_messages::{Flow, FrameHeader, FrameShape, Kind, Refusal};
use tessera_stage::{Pulse, StageContext, StageError};
use tessera_surface::WorkloadLevel;
use tessera_transport::{Link, Received, SliceSubscriber, Subscriber};

/// A checked frame: a copy of its header, what it stands for, and the frame in place.
pub(crate) type CheckedFrame = (FrameHeader, Kind, Received<FrameHeader, u16>);

/// Frames as they come from the sensor.
pub(crate) struct Feed {
    frames: SliceSubscriber<FrameHeader, u16>,
    flow: Subscriber<Flow>,
    newest_flow: Option<Flow>,
    /// Image size of the run's camera.
    pub(crate) shape: FrameShape,
    window: u64,
    /// Frames of the source, where known.
    n_frames: Option<u64>,
    is_live: bool,
    /// Whether workload may be lowered: in live mode alone.
    sheds_load: bool,
    /// The frame received last, to count what is missing (live mode).
    last_index: Option<u64>,
    /// Frames left out before the next one, by the sensor or here.
    dropped: u64,
    /// Frames that ended this stage again and again (live mode).
    poison: BTreeSet<u64>,
}

impl Feed {
    pub(crate) fn open(link: &Link, context: &StageContext) -> Result<Self, StageError> {
        Ok(Self {
            frames: link.frame_subscriber()?,
            flow: link.flow_subscriber()?,
            newest_flow: None,
            shape: link.layout().frame,
            window: link.layout().window.into(),
            n_frames: context.run.n_frames,
            is_live: context.settings.run.live,
            sheds_load: context.settings.run.live && context.settings.flow.load_shedding,
            last_index: None,
            dropped: 0,
            poison: context.poison.clone(),
        })
    }

    /// Whether the aligner has everything.
    pub(crate) fn is_finished(&mut self) -> Result<bool, StageError> {
        if let Some(flow) = self.flow.newest()?
            && flow.validate().is_ok()
        {
            self.newest_flow = Some(flow);
        }
        Ok(self.newest_flow.is_some_and(|flow| flow.finished == 1))
    }

    /// How much work the aligner wants put into a frame.
    pub(crate) fn workload(&self) -> WorkloadLevel {
        self.newest_flow.filter(|_| self.sheds_load).map_or(WorkloadLevel::Full, |flow| flow.workload())
    }

    /// The next frame worth working on; bad ones are counted and left out.
    pub(crate) fn next(&mut self, pulse: &mut Pulse) -> Result<Option<CheckedFrame>, StageError> {
        let mut newest: Option<CheckedFrame> = None;
        while let Some(frame) = self.frames.receive()? {
            let header = frame.header();
            let checked = header.validate(self.shape, self.limit(header.epoch)).and_then(|kind| {
                // One that has just begun does not know.
                let next = self.last_index.map_or(header.index, |last| last.saturating_add(1));
                Refusal::unless_in_source(header.index, kind, self.n_frames, next)?;
                Ok(kind)
            });
            let kind = match checked {
                Ok(kind) => kind,
                Err(refusal) => {
                    tracing::warn!(frame = header.index, "refused: {refusal}");
                    pulse.beat.refused = pulse.beat.refused.saturating_add(1);
                    continue;
                }
            };
            if !self.is_live {
                if self.known_flow(header.epoch).is_some_and(|flow| header.index < flow.acknowledged) {
                    pulse.beat.duplicates = pulse.beat.duplicates.saturating_add(1);
                    continue;
                }
                return Ok(Some((header, kind, frame)));
            }
            if kind == Kind::End && newest.is_some() {
                // The end comes again; the last frame does not.
                continue;
            }
            self.count(&header, pulse);
            if kind == Kind::Frame && self.poison.contains(&header.index) {
                tracing::warn!(frame = header.index, "lost: it ended reconstruct again and again");
                pulse.beat.lost = pulse.beat.lost.saturating_add(1);
                self.dropped = self.dropped.saturating_add(1);
                continue;
            }
            if newest.replace((header, kind, frame)).is_some() {
                pulse.beat.dropped = pulse.beat.dropped.saturating_add(1);
                self.dropped = self.dropped.saturating_add(1);
            }
        }
        if let Some((header, ..)) = &mut newest {
            header.dropped_before = std::mem::take(&mut self.dropped);
        }
        Ok(newest)
    }

    /// What the aligner said last, unless the sensor has already heard of a newer epoch.
    fn known_flow(&self, epoch: u64) -> Option<Flow> {
        self.newest_flow.filter(|flow| epoch <= flow.epoch)
    }

    /// First index that cannot be in flight: the window above what was acknowledged, and once more
    /// because the sensor may have heard of an acknowledgement before us.
    fn limit(&self, epoch: u64) -> Option<u64> {
        let flow = self.known_flow(epoch).filter(|_| !self.is_live)?;
        Some(flow.acknowledged.saturating_add(self.window.saturating_mul(2).saturating_add(1)))
    }

    /// Live mode: what the sensor left out, and what was overwritten in our queue.
    fn count(&mut self, header: &FrameHeader, pulse: &mut Pulse) {
        let gap = self
            .last_index
            .map_or(header.dropped_before, |last| header.index.saturating_sub(last).saturating_sub(1));
        self.dropped = self.dropped.saturating_add(gap);
        pulse.beat.dropped = pulse.beat.dropped.saturating_add(gap.saturating_sub(header.dropped_before));
        self.last_index = Some(header.index);
    }
}
