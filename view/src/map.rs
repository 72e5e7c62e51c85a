//! Keyframes and their graph, logged as they come and as they move: never the map as a whole.

use crate::error::ViewError;
use crate::scene::{BLUE, GREEN, GREY, ORANGE, VERMILION, colour, log, place, points, transform};
use re_sdk::RecordingStream;
use re_sdk_types::archetypes::{LineStrips3D, Points3D};
use std::collections::{BTreeMap, BTreeSet};
use tessera_geometry::Pose;
use tessera_mapping::{AlignRecord, Correction, KeyframeRecord, KeyframeSurfaces, LoopVerdict, MapRecord};
use tessera_stage::MappedKeyframes;

/// Radius of a keyframe's points and of the graph's lines, metres.
const POINT_M: f32 = 0.004;
const LINE_M: f32 = 0.003;

/// A fold over the aligner's journal, and what of it has not been logged yet.
pub(crate) struct Map {
    surfaces: MappedKeyframes,
    most_points: usize,
    /// `world_from_camera` by id, as corrected so far.
    poses: Vec<Pose>,
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
    pub(crate) fn new(surfaces: MappedKeyframes, most_points: usize) -> Self {
        Self {
            surfaces,
            most_points,
            poses: Vec::new(),
            edges: Vec::new(),
            loops: BTreeMap::new(),
            fresh: BTreeSet::new(),
            changed: BTreeSet::new(),
        }
    }

    /// The corrected pose of a keyframe.
    pub(crate) fn pose(&self, id: u32) -> Option<&Pose> {
        self.poses.get(id as usize)
    }

    /// Takes the next record in.
    pub(crate) fn apply(&mut self, record: &AlignRecord) -> Result<(), ViewError> {
        self.surfaces.take(record)?;
        match record {
            AlignRecord::Map(map) => self.add_map(map),
            AlignRecord::Frame(frame) => {
                if let Some(keyframe) = &frame.new_keyframe {
                    self.add(keyframe);
                }
                for moved in &frame.moved {
                    self.move_to(moved.id, Pose::from(&moved.world_from_camera));
                }
            }
            AlignRecord::Correction(applied) => self.correct(&applied.correction),
            AlignRecord::Skipped(..) | AlignRecord::End { .. } => {}
        }
        Ok(())
    }

    fn add_map(&mut self, map: &MapRecord) {
        for keyframe in &map.keyframes {
            self.push(Pose::from(&keyframe.world_from_camera), Vec::new());
        }
    }

    fn add(&mut self, keyframe: &KeyframeRecord) {
        let edges = keyframe.edges.iter().map(|edge| edge.to).collect();
        self.push(Pose::from(&keyframe.world_from_camera), edges);
    }

    fn push(&mut self, world_from_camera: Pose, edges: Vec<u32>) {
        let id = self.poses.len() as u32;
        self.poses.push(world_from_camera);
        self.edges.push(edges);
        self.fresh.insert(id);
        self.changed.insert(id);
    }

    fn move_to(&mut self, id: u32, world_from_camera: Pose) {
        if let Some(pose) = self.poses.get_mut(id as usize) {
            *pose = world_from_camera;
            self.changed.insert(id);
        }
    }

    /// Moves the keyframes; those made since the request was answered hang on the last of it.
    fn correct(&mut self, correction: &Correction) {
        let mut new_from_old = None;
        let mut n_corrected = 0;
        for corrected in &correction.keyframes {
            let Some(old) = self.poses.get(corrected.id as usize).copied() else { continue };
            let new = Pose::from(&corrected.world_from_camera);
            new_from_old = Some(new * old.inverse());
            n_corrected = n_corrected.max(corrected.id as usize + 1);
            if new != old {
                self.move_to(corrected.id, new);
            }
        }
        if let Some(new_from_old) = new_from_old {
            for id in n_corrected..self.poses.len() {
                self.move_to(id as u32, new_from_old * self.poses[id]);
            }
        }
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
            let (positions, colours) = points(self.surfaces.vertices(id), self.most_points);
            let surface = Points3D::new(positions).with_colors(colours).with_radii([POINT_M]);
            log(recording, &format!("world/map/{id}/surface"), &surface)?;
        }
        let changed = std::mem::take(&mut self.changed);
        for id in &changed {
            if let Some(pose) = self.pose(*id) {
                log(recording, &format!("world/map/{id}"), &transform(pose))?;
            }
        }
        // A line follows both of its ends.
        let ends = |newer: &u32| self.older(*newer).any(|(older, _)| changed.contains(&older));
        let newer = (0..self.poses.len() as u32).filter(|id| changed.contains(id) || ends(id));
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
        let Some(from) = self.pose(newer) else { return Ok(()) };
        let mut strips = Vec::new();
        let mut colours = Vec::new();
        for (older, line) in self.older(newer) {
            let Some(to) = self.pose(older) else { continue };
            strips.push([place(from), place(to)]);
            colours.push(colour(line));
        }
        let lines = LineStrips3D::new(strips).with_colors(colours).with_radii([LINE_M]);
        log(recording, &format!("world/graph/{newer}/lines"), &lines)?;
        let dot = Points3D::new([place(from)]).with_colors([colour(BLUE)]).with_radii([3.0 * LINE_M]);
        log(recording, &format!("world/graph/{newer}"), &dot)
    }
}

/// Colours as in the report.
fn of_verdict(verdict: LoopVerdict) -> [u8; 3] {
    match verdict {
        LoopVerdict::Accepted => GREEN,
        LoopVerdict::Outvoted => VERMILION,
        LoopVerdict::LittleOverlap | LoopVerdict::FreeSpaceViolated | LoopVerdict::Inconsistent => ORANGE,
    }
}
