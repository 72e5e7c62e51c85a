//! Keyframes and their graph, logged as they come and as they move: never the map as a whole.

use crate::error::ViewError;
use crate::scene::{BLUE, GREEN, GREY, ORANGE, VERMILION, colour, log, place, points, transform};
use re_sdk::RecordingStream;
use re_sdk_types::archetypes::{LineStrips3D, Points3D};
use std::collections::{BTreeMap, BTreeSet};
use tessera_geometry::Pose;
use tessera_slam::{AlignRecord, Correction, KeyframeRecord, LoopVerdict, PoseHistory};
use tessera_stage::StoredKeyframes;

/// Radius of a keyframe's points and of the graph's lines, metres.
const POINT_M: f32 = 0.004;
const LINE_M: f32 = 0.003;

/// A fold over the aligner's journal, and what of it has not been logged yet.
pub(crate) struct Map {
    surfaces: StoredKeyframes,
    most_points: usize,
    /// Poses of keyframes and frames as corrected so far.
    poses: PoseHistory,
    /// Older keyframes that each is aligned to, by id.
    edges: Vec<Vec<u32>>,
    /// Verdicts by newer and older keyframe.
    loops: BTreeMap<(u32, u32), LoopVerdict>,
    /// Keyframes whose surface was not logged yet.
    fresh: BTreeSet<u32>,
    /// Keyframes that moved or whose loops were judged since they were logged.
    changed: BTreeSet<u32>,
}

impl Map {
    pub(crate) fn new(surfaces: StoredKeyframes, most_points: usize) -> Self {
        Self {
            surfaces,
            most_points,
            poses: PoseHistory::default(),
            edges: Vec::new(),
            loops: BTreeMap::new(),
            fresh: BTreeSet::new(),
            changed: BTreeSet::new(),
        }
    }

    /// Poses of keyframes and frames as corrected so far.
    pub(crate) fn poses(&self) -> &PoseHistory {
        &self.poses
    }

    /// Takes the next record in.
    pub(crate) fn apply(&mut self, record: &AlignRecord) -> Result<(), ViewError> {
        self.surfaces.take(record)?;
        let before: Vec<Pose> = match record {
            // It moves nothing, and most records are like it.
            AlignRecord::Frame(frame)
                if frame.change.moved.is_empty() && frame.change.new_keyframe.is_none() =>
            {
                return Ok(());
            }
            _ => self.poses.keyframe_poses().collect(),
        };
        self.poses.apply(record);
        let moved =
            self.poses.keyframe_poses().zip(&before).enumerate().filter(|(_, (new, old))| new != *old);
        self.changed.extend(moved.map(|(id, _)| id as u32));
        let added = before.len() as u32..self.poses.n_keyframes() as u32;
        self.fresh.extend(added.clone());
        self.changed.extend(added);
        match record {
            AlignRecord::Map(_) => self.edges.resize(self.poses.n_keyframes(), Vec::new()),
            AlignRecord::Frame(frame) => {
                let edges = |keyframe: &KeyframeRecord| -> Vec<u32> {
                    keyframe.edges.iter().map(|edge| edge.to).collect()
                };
                self.edges.extend(frame.change.new_keyframe.as_ref().map(edges));
            }
            AlignRecord::Correction(applied) => self.apply_verdicts(&applied.correction),
            AlignRecord::Skipped(..) | AlignRecord::End { .. } => {}
        }
        Ok(())
    }

    /// Takes in the verdicts on loop pairs.
    fn apply_verdicts(&mut self, correction: &Correction) {
        for pair in &correction.loops {
            if self.loops.insert((pair.newer, pair.older), pair.verdict) != Some(pair.verdict) {
                self.changed.insert(pair.newer);
            }
        }
    }

    /// Logs what has changed since the last time.
    pub(crate) fn log(&mut self, recording: &RecordingStream) -> Result<(), ViewError> {
        if self.changed.is_empty() {
            return Ok(());
        }
        let fresh = std::mem::take(&mut self.fresh);
        for id in fresh {
            let (positions, colours) = points(&self.surfaces.load(id)?, self.most_points);
            let surface = Points3D::new(positions).with_colors(colours).with_radii([POINT_M]);
            log(recording, &format!("world/map/{id}/surface"), &surface)?;
        }
        let changed = std::mem::take(&mut self.changed);
        for id in &changed {
            if let Some(pose) = self.poses.keyframe_pose(*id) {
                log(recording, &format!("world/map/{id}"), &transform(&pose))?;
            }
        }
        // A line follows both of its ends.
        let ends = |newer: &u32| self.older(*newer).any(|(older, _)| changed.contains(&older));
        let newer = (0..self.poses.n_keyframes() as u32).filter(|id| changed.contains(id) || ends(id));
        for id in newer {
            self.log_lines(recording, id)?;
        }
        Ok(())
    }

    /// What a keyframe is joined to, with the colour of the line.
    fn older(&self, newer: u32) -> impl Iterator<Item = (u32, [u8; 3])> + '_ {
        let of = move |older: u32| self.loops.get(&(newer, older)).copied();
        let edges = self.edges.get(newer as usize).into_iter().flatten();
        let plain = edges.copied().filter(move |older| of(*older).is_none()).map(|older| (older, GREY));
        let loops = self.loops.range((newer, 0)..=(newer, u32::MAX));
        plain.chain(loops.map(|((_, older), verdict)| (*older, of_verdict(*verdict))))
    }

    fn log_lines(&self, recording: &RecordingStream, newer: u32) -> Result<(), ViewError> {
        let Some(from) = self.poses.keyframe_pose(newer) else { return Ok(()) };
        let mut strips = Vec::new();
        let mut colours = Vec::new();
        for (older, line) in self.older(newer) {
            let Some(to) = self.poses.keyframe_pose(older) else { continue };
            strips.push([place(&from), place(&to)]);
            colours.push(colour(line));
        }
        let lines = LineStrips3D::new(strips).with_colors(colours).with_radii([LINE_M]);
        log(recording, &format!("world/graph/{newer}/lines"), &lines)?;
        let dot = Points3D::new([place(&from)]).with_colors([colour(BLUE)]).with_radii([3.0 * LINE_M]);
        log(recording, &format!("world/graph/{newer}"), &dot)
    }
}

/// Colours as in the report.
fn of_verdict(verdict: LoopVerdict) -> [u8; 3] {
    match verdict {
        LoopVerdict::Accepted => GREEN,
        LoopVerdict::Outvoted => VERMILION,
        LoopVerdict::LittleOverlap
        | LoopVerdict::FreeSpaceViolated
        | LoopVerdict::Inconsistent
        | LoopVerdict::Contradicted => ORANGE,
    }
}
