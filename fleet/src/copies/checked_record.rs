//! A record of a robot's aligner every number of which may be used: each keyframe, submap and request that
//! it names is there, poses are poses, and a map comes first or not at all.

use crate::copies::checked::RunFacts;
use tessera_geometry::PoseBits;
use tessera_slam::{
    AlignRecord, Correction, FrameRecord, JoinRecord, KeyframePose, KeyframeRecord, MapRecord, Submaps,
};
use tessera_stage::slots;

/// Bytes of a keyframe's surface, at most.
const MAX_SURFACE_BYTES: u64 = 256 << 20;
/// Bytes of a store, at most.
const MAX_STORE_BYTES: u64 = 1 << 42;
/// Largest coordinate of a pose, metres.
const MAX_COORDINATE_M: f64 = 1e6;
/// Numbers of a covariance: the upper triangle of a 6x6 matrix.
const COVARIANCE_LEN: usize = 21;

/// A record that was checked against all before it.
pub(crate) struct CheckedRecord(pub(crate) AlignRecord);

impl CheckedRecord {
    /// Checks the record that comes next in a run of which `facts` are known.
    ///
    /// # Errors
    /// Names the number that cannot be.
    pub(crate) fn check(record: AlignRecord, facts: &RunFacts) -> Result<Self, String> {
        check_slots(&record, facts)?;
        match &record {
            AlignRecord::Frame(frame) => check_frame(frame, facts)?,
            AlignRecord::Correction(applied) => check_correction(&applied.correction, facts)?,
            AlignRecord::Map(map) if facts.n_records == 0 => check_map(map)?,
            AlignRecord::Map(_) => {
                return Err(format!("a map behind {} records, expected it first", facts.n_records));
            }
            AlignRecord::Skipped(skipped) if skipped.frames.is_empty() => {
                return Err(format!("no frames are left out: {:?}", skipped.frames));
            }
            AlignRecord::End { request: Some(request), .. } => {
                check_n_keyframes(request.n_keyframes, facts.slots.len())?;
            }
            AlignRecord::Skipped(_) | AlignRecord::End { request: None, .. } => {}
        }
        Ok(Self(record))
    }
}

fn check_slots(record: &AlignRecord, facts: &RunFacts) -> Result<(), String> {
    for ((id, slot), expected) in slots(record).zip(facts.slots.len()..) {
        if id as usize != expected {
            return Err(format!("keyframe {id}, expected {expected}"));
        }
        if slot.len > MAX_SURFACE_BYTES || slot.offset > MAX_STORE_BYTES {
            return Err(format!("a surface of {} bytes at {} of the store", slot.len, slot.offset));
        }
    }
    Ok(())
}

fn check_frame(frame: &FrameRecord, facts: &RunFacts) -> Result<(), String> {
    // The one that this frame makes may be named by it.
    let n = facts.slots.len().saturating_add(1);
    let n_submaps = check_submap(frame, facts)?;
    check_numbers(&frame.pose.velocity)?;
    check_covariance(&frame.pose.covariance)?;
    check_ids(frame.evidence.blocks.iter().map(|block| block.keyframe).chain([frame.pose.keyframe]), n)?;
    frame.evidence.blocks.iter().try_for_each(|block| check_pose(&block.keyframe_from_camera))?;
    if let Some(sighting) = &frame.change.sighting {
        check_ids([sighting.seen, sighting.own].into_iter(), n)?;
        check_pose(&sighting.seen_from_own)?;
    }
    for join in frame.change.join.iter().chain(&frame.change.refused) {
        check_join(join, n_submaps)?;
    }
    // It may name the keyframe that comes next.
    check_ids(
        frame.change.contradiction.iter().flat_map(|known| [known.first, known.seen]),
        n.saturating_add(1),
    )?;
    if let Some(request) = &frame.change.request {
        check_n_keyframes(request.n_keyframes, n)?;
    }
    if let Some(keyframe) = &frame.change.new_keyframe {
        check_new_keyframe(keyframe, n)?;
    }
    check_poses(&frame.change.moved, facts)?;
    let poses = [frame.pose.world_from_camera, frame.pose.keyframe_from_camera, frame.pose.world_from_odom];
    poses.iter().try_for_each(check_pose)
}

fn check_new_keyframe(keyframe: &KeyframeRecord, n: usize) -> Result<(), String> {
    check_numbers(&keyframe.velocity)?;
    check_pose(&keyframe.world_from_camera)?;
    let named = keyframe.edges.iter().map(|edge| edge.to).chain(keyframe.alike.iter().copied());
    let retired = keyframe.retires.iter().flat_map(|retired| [retired.keyframe, retired.anchored_to]);
    check_ids(named.chain(retired), n)
}

/// A submap is known or the next one; a split makes one to three. Answers how many there are behind it.
fn check_submap(frame: &FrameRecord, facts: &RunFacts) -> Result<u32, String> {
    let mut next = facts.n_submaps;
    if let Some(split) = &frame.change.split {
        let n_made = u32::try_from(split.firsts().count()).unwrap_or(u32::MAX);
        next = next.saturating_add(n_made.saturating_sub(1));
        check_ids(split.firsts(), facts.slots.len().saturating_add(1))?;
    }
    match frame.submap {
        submap if submap <= next && (frame.change.split.is_none() || submap == next) => {
            Ok(facts.n_submaps.max(submap.saturating_add(1)))
        }
        submap => Err(format!("submap {submap}, there are {}", facts.n_submaps)),
    }
}

fn check_join(join: &JoinRecord, n_submaps: u32) -> Result<(), String> {
    check_pose(&join.kept_from_moved)?;
    match [join.kept, join.moved].into_iter().find(|component| *component >= n_submaps) {
        Some(component) => Err(format!("component {component} is joined, there are {n_submaps} submaps")),
        None => Ok(()),
    }
}

fn check_correction(correction: &Correction, facts: &RunFacts) -> Result<(), String> {
    check_submaps(&correction.submaps, facts.n_submaps)?;
    let keyframes = &correction.keyframes;
    if !keyframes.is_sorted_by(|a, b| a.id < b.id) {
        return Err("corrected keyframes that are not in order".to_owned());
    }
    check_poses(keyframes, facts)?;
    check_ids(correction.loops.iter().flat_map(|pair| [pair.newer, pair.older]), facts.slots.len())?;
    correction.frames.iter().try_for_each(|(_, pose)| check_pose(pose))
}

fn check_map(map: &MapRecord) -> Result<(), String> {
    check_submaps(&map.submaps, u32::MAX)?;
    let n = map.keyframes.len();
    for keyframe in &map.keyframes {
        if keyframe.submap >= map.submaps.n().max(1) {
            return Err(format!("keyframe {} of submap {}", keyframe.id, keyframe.submap));
        }
        if keyframe.session as usize >= n {
            return Err(format!("keyframe {} of run {}", keyframe.id, keyframe.session));
        }
        check_pose(&keyframe.world_from_camera)?;
        check_numbers(&keyframe.velocity)?;
        check_covariance(&keyframe.covariance)?;
        let named = keyframe.edges.iter().map(|edge| edge.to).chain(keyframe.alike.iter().copied());
        check_ids(named.chain(keyframe.anchored_to), n)?;
    }
    map.start.iter().try_for_each(check_pose)
}

fn check_submaps(submaps: &Submaps, most: u32) -> Result<(), String> {
    if submaps.n() > most {
        return Err(format!("{} submaps, there are {most}", submaps.n()));
    }
    match submaps.is_consistent() {
        true => Ok(()),
        false => Err("components that are not named by their first submap".to_owned()),
    }
}

fn check_poses(poses: &[KeyframePose], facts: &RunFacts) -> Result<(), String> {
    for pose in poses {
        if pose.id as usize >= facts.slots.len() {
            return Err(format!("a pose of keyframe {}, there are {}", pose.id, facts.slots.len()));
        }
        check_pose(&pose.world_from_camera)?;
    }
    Ok(())
}

fn check_n_keyframes(found: u32, n: usize) -> Result<(), String> {
    match found as usize <= n {
        true => Ok(()),
        false => Err(format!("a request for {found} keyframes, there are {n}")),
    }
}

/// Keyframes that are named must be there, `n` of them.
fn check_ids(mut ids: impl Iterator<Item = u32>, n: usize) -> Result<(), String> {
    match ids.find(|id| *id as usize >= n) {
        None => Ok(()),
        Some(id) => Err(format!("keyframe {id} is named, there are {n}")),
    }
}

/// Its numbers are not checked: a direction that is open may have any.
fn check_covariance(numbers: &[f64]) -> Result<(), String> {
    match numbers.len() {
        0 | COVARIANCE_LEN => Ok(()),
        n => Err(format!("a covariance of {n} numbers, expected {COVARIANCE_LEN} or none")),
    }
}

fn check_numbers(numbers: &[f64]) -> Result<(), String> {
    if numbers.iter().all(|v| v.is_finite()) {
        Ok(())
    } else {
        Err(format!("numbers that are none: {numbers:?}"))
    }
}

fn check_pose(pose: &PoseBits) -> Result<(), String> {
    let is_near = pose.translation_m.iter().all(|v| v.abs() <= MAX_COORDINATE_M);
    if pose.is_valid() && is_near { Ok(()) } else { Err(format!("a pose that none can have: {pose:?}")) }
}

#[cfg(test)]
mod tests;
