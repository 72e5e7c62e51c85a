//! What the records of a robot's aligner say, checked before they are written down at the base: a robot
//! that lies may spoil its own map and nothing else.

use tessera_journal::decode;
use tessera_slam::{
    AlignRecord, FrameRecord, KeyframePose, KeyframeState, OptimiseRecord, SplitRecord, State, StoreSlot,
};
use tessera_stage::slots;

/// Bytes of a keyframe's surface, at most.
const MAX_SURFACE_BYTES: u64 = 256 << 20;
/// Bytes of a store, at most.
const MAX_STORE_BYTES: u64 = 1 << 42;
/// Largest coordinate of a pose, metres.
const MAX_COORDINATE_M: f64 = 1e6;

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
    n_submaps: u32,
}

/// Newest active keyframes, none of which a run culls.
const UNSETTLED: usize = 5;
/// Requests without an effect that are known at a time: a run has one, and at its end another.
const MOST_REQUESTS: usize = 2;

impl RunFacts {
    /// Takes the payload of a record in.
    ///
    /// # Errors
    /// Says what in it cannot be.
    pub fn take(&mut self, payload: &[u8]) -> Result<(), String> {
        let record: AlignRecord = decode(payload)?;
        self.check(&record)?;
        self.slots.extend(slots(&record).map(|(_, slot)| *slot));
        self.note_active(&record);
        match record {
            AlignRecord::Frame(frame) => {
                self.n_frames += 1;
                self.n_tracked += u64::from(frame.state == State::Tracking);
                self.n_submaps = self.n_submaps.max(frame.submap + 1);
                self.note_request(frame.request.map(|request| request.request));
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
            AlignRecord::Skipped(..) => {}
        }
        Ok(())
    }

    fn note_active(&mut self, record: &AlignRecord) {
        match record {
            AlignRecord::Map(map) => {
                self.is_active.extend(map.keyframes.iter().map(KeyframeState::is_active))
            }
            AlignRecord::Frame(frame) => {
                if let Some(keyframe) = &frame.new_keyframe {
                    self.is_active.push(true);
                    for retired in &keyframe.retires {
                        self.is_active[retired.keyframe as usize] = false;
                    }
                }
                if let Some(SplitRecord { carried: Some(carried), first, .. }) = frame.split {
                    let carried = self.is_active.iter_mut().take(first as usize).skip(carried as usize);
                    carried.for_each(|is_active| *is_active = false);
                }
            }
            AlignRecord::Skipped(..) | AlignRecord::Correction(_) | AlignRecord::End { .. } => {}
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
        self.slots.iter().map(|slot| slot.offset + slot.len).max().unwrap_or(0)
    }

    fn check(&self, record: &AlignRecord) -> Result<(), String> {
        for ((id, slot), expected) in slots(record).zip(self.slots.len()..) {
            if id as usize != expected {
                return Err(format!("keyframe {id}, expected {expected}"));
            }
            let is_inside = slot.len <= MAX_SURFACE_BYTES && slot.offset <= MAX_STORE_BYTES;
            if !is_inside {
                return Err(format!("a surface of {} bytes at {} of the store", slot.len, slot.offset));
            }
        }
        match record {
            AlignRecord::Frame(frame) => {
                self.check_submap(frame)?;
                check_numbers(&frame.velocity)?;
                if let Some(keyframe) = &frame.new_keyframe {
                    check_numbers(&keyframe.velocity)?;
                    let named = keyframe.edges.iter().map(|edge| edge.to);
                    let retired = keyframe.retires.iter().flat_map(|r| [r.keyframe, r.anchored_to]);
                    check_ids(named.chain(retired), self.slots.len() + 1)?;
                }
                self.check_poses(&frame.moved)?;
                let made = frame.new_keyframe.as_ref().map(|k| k.world_from_camera);
                [frame.world_from_camera, frame.keyframe_from_camera, frame.world_from_odom]
                    .into_iter()
                    .chain(made)
                    .try_for_each(|pose| check_pose(&pose))
            }
            AlignRecord::Correction(applied) => {
                if applied.correction.submaps.n() > self.n_submaps {
                    return Err(format!(
                        "{} submaps, there are {}",
                        applied.correction.submaps.n(),
                        self.n_submaps
                    ));
                }
                let keyframes = &applied.correction.keyframes;
                if !keyframes.is_sorted_by(|a, b| a.id < b.id) {
                    return Err("corrected keyframes that are not in order".to_owned());
                }
                self.check_poses(keyframes)?;
                applied.correction.frames.iter().try_for_each(|(_, pose)| check_pose(pose))
            }
            AlignRecord::Map(map) => {
                for keyframe in &map.keyframes {
                    if keyframe.submap >= map.submaps.n().max(1) {
                        return Err(format!("keyframe {} of submap {}", keyframe.id, keyframe.submap));
                    }
                    check_pose(&keyframe.world_from_camera)?;
                    check_numbers(&keyframe.velocity)?;
                    let named = keyframe.edges.iter().map(|edge| edge.to);
                    check_ids(named.chain(keyframe.anchored_to), map.keyframes.len())?;
                    if keyframe.session as usize >= map.keyframes.len() {
                        return Err(format!("keyframe {} of run {}", keyframe.id, keyframe.session));
                    }
                }
                Ok(())
            }
            AlignRecord::Skipped(..) | AlignRecord::End { .. } => Ok(()),
        }
    }

    /// A submap is known or the next one; a split makes one to three.
    fn check_submap(&self, frame: &FrameRecord) -> Result<(), String> {
        let mut next = self.n_submaps;
        if let Some(split) = &frame.split {
            next += split.firsts().count() as u32 - 1;
            check_ids(split.firsts(), self.slots.len() + 1)?;
        }
        match frame.submap {
            submap if submap <= next && (frame.split.is_none() || submap == next) => Ok(()),
            submap => Err(format!("submap {submap}, there are {}", self.n_submaps)),
        }
    }

    fn check_poses(&self, poses: &[KeyframePose]) -> Result<(), String> {
        for pose in poses {
            if pose.id as usize >= self.slots.len() {
                return Err(format!("a pose of keyframe {}, there are {}", pose.id, self.slots.len()));
            }
            check_pose(&pose.world_from_camera)?;
        }
        Ok(())
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
    /// Takes the payload of a record in.
    ///
    /// # Errors
    /// Where it is none.
    pub fn take(&mut self, payload: &[u8]) -> Result<(), String> {
        let record: OptimiseRecord = decode(payload)?;
        self.n_answered = self.n_answered.max(record.correction().request.saturating_add(1));
        self.n_from_base += u64::from(matches!(record, OptimiseRecord::FromBase(_)));
        Ok(())
    }
}

/// Keyframes that are named must be there, `n` of them.
fn check_ids(mut ids: impl Iterator<Item = u32>, n: usize) -> Result<(), String> {
    match ids.find(|id| *id as usize >= n) {
        None => Ok(()),
        Some(id) => Err(format!("keyframe {id} is named, there are {n}")),
    }
}

fn check_numbers(numbers: &[f64]) -> Result<(), String> {
    if numbers.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(format!("numbers that are none: {numbers:?}"))
    }
}

fn check_pose(pose: &tessera_geometry::PoseBits) -> Result<(), String> {
    let is_near = pose.translation_m.iter().all(|v| v.abs() <= MAX_COORDINATE_M);
    if pose.is_valid() && is_near { Ok(()) } else { Err(format!("a pose that none can have: {pose:?}")) }
}
