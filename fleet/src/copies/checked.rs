//! What the records of a robot's aligner say, checked before they are written down at the base: a robot
//! that lies may spoil its own map and nothing else.

use crate::copies::checked_record::CheckedRecord;
use tessera_slam::{AlignRecord, KeyframeState, SplitRecord, State, StoreSlot};
use tessera_stage::{ALIGN_JOURNAL, OPTIMISE_JOURNAL, slots};

/// What was seen of a run's journal so far.
#[derive(Clone, Debug, Default)]
pub struct RunFacts {
    /// Where each keyframe's surface lies, by id.
    pub slots: Vec<StoreSlot>,
    /// Whether each keyframe belongs to the working map still, by id.
    pub is_active: Vec<bool>,
    /// Frames with a record.
    pub n_frames: u64,
    /// Frames that were tracked.
    pub n_tracked: u64,
    /// The final request, once the source is exhausted: `Some(None)` where nothing is to be optimised.
    final_request: Option<Option<u64>>,
    /// The run has come to its end with its last correction.
    pub is_ended: bool,
    /// The last requests for an optimisation that have no effect yet.
    pub requests: Vec<u64>,
    /// Requests whose corrections have taken effect: all below this one.
    pub n_applied: u64,
    pub(crate) n_submaps: u32,
    /// Records of all kinds.
    pub(crate) n_records: u64,
}

/// Newest active keyframes, none of which a run culls.
const UNSETTLED: usize = 5;
/// Requests without an effect that are known at a time: a run has one, and at its end another.
const MOST_REQUESTS: usize = 2;

impl RunFacts {
    /// Takes the payload of a record of this version in.
    ///
    /// # Errors
    /// Names the number in it that cannot be.
    pub fn take(&mut self, version: u32, payload: &[u8]) -> Result<(), String> {
        let record = CheckedRecord::check(ALIGN_JOURNAL.read(version, payload)?, self)?;
        self.note(record);
        Ok(())
    }

    fn note(&mut self, CheckedRecord(record): CheckedRecord) {
        self.slots.extend(slots(&record).map(|(_, slot)| *slot));
        self.note_active(&record);
        self.n_records = self.n_records.saturating_add(1);
        match record {
            AlignRecord::Frame(frame) => {
                self.n_frames = self.n_frames.saturating_add(1);
                let is_tracked = frame.state == State::Tracking;
                self.n_tracked = self.n_tracked.saturating_add(is_tracked.into());
                self.n_submaps = self.n_submaps.max(frame.submap.saturating_add(1));
                self.note_request(frame.change.request.map(|request| request.request));
            }
            AlignRecord::Map(map) => self.n_submaps = self.n_submaps.max(map.submaps.n()),
            AlignRecord::End { request, .. } => {
                let request = request.map(|request| request.request);
                self.note_request(request);
                self.is_ended = request.is_none();
                self.final_request = Some(request);
            }
            AlignRecord::Correction(applied) => {
                let request = applied.correction.request;
                self.is_ended |= self.final_request == Some(Some(request));
                self.n_applied = self.n_applied.max(request.saturating_add(1));
                self.requests.retain(|pending| *pending > request);
            }
            AlignRecord::Skipped(_) => {}
        }
    }

    fn note_active(&mut self, record: &AlignRecord) {
        match record {
            AlignRecord::Map(map) => {
                self.is_active.extend(map.keyframes.iter().map(KeyframeState::is_active))
            }
            AlignRecord::Frame(frame) => {
                if let Some(keyframe) = &frame.change.new_keyframe {
                    self.is_active.push(true);
                    for retired in &keyframe.retires {
                        if let Some(is_active) = self.is_active.get_mut(retired.keyframe as usize) {
                            *is_active = false;
                        }
                    }
                }
                if let Some(SplitRecord { carried: Some(carried), first, .. }) = frame.change.split {
                    let carried = self.is_active.iter_mut().take(first as usize).skip(carried as usize);
                    carried.for_each(|is_active| *is_active = false);
                }
            }
            AlignRecord::Skipped(_) | AlignRecord::Correction(_) | AlignRecord::End { .. } => {}
        }
    }

    /// Active keyframes whose surfaces are wanted now, rising: all, or while a robot is on its way
    /// (`is_moving`) those behind the newest ones, each of which may be culled soon.
    pub fn wanted(&self, is_moving: bool) -> Vec<u32> {
        let active = (0..).zip(&self.is_active).filter(|(_, is_active)| **is_active).map(|(id, _)| id);
        let mut active: Vec<u32> = active.collect();
        if is_moving && self.final_request.is_none() && self.requests.is_empty() {
            active.truncate(active.len().saturating_sub(UNSETTLED));
        }
        active
    }

    fn note_request(&mut self, request: Option<u64>) {
        self.requests.extend(request);
        let n_too_many = self.requests.len().saturating_sub(MOST_REQUESTS);
        self.requests.drain(..n_too_many);
    }

    /// Bytes of the store that the keyframes so far need.
    pub fn store_bytes(&self) -> u64 {
        self.slots.iter().map(|slot| slot.offset.saturating_add(slot.len)).max().unwrap_or(0)
    }
}

/// What the records of a robot's optimiser say.
#[derive(Clone, Copy, Debug, Default)]
pub struct AnswerFacts {
    /// Requests that are answered: all below this one.
    pub n_answered: u64,
    /// Answers that came from a base.
    pub n_from_base: u64,
}

impl AnswerFacts {
    /// Takes the payload of a record of this version in.
    ///
    /// # Errors
    /// Where it is none.
    pub fn take(&mut self, version: u32, payload: &[u8]) -> Result<(), String> {
        let record = OPTIMISE_JOURNAL.read(version, payload)?;
        self.n_answered = self.n_answered.max(record.correction().request.saturating_add(1));
        let is_from_base = record.is_from_base();
        self.n_from_base = self.n_from_base.saturating_add(is_from_base.into());
        Ok(())
    }
}
