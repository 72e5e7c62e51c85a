//! The newest keyframes solved for together with the frame, from the blocks that they have (method 7): the extended
//! window of Holz and Behnke (III-G) without a search, and for each new keyframe.
//!
//! A window of fixed poses carries the error of each keyframe on to those that are aligned to it; what a later view
//! measures of an earlier one corrects it.

use crate::map::detection;
use crate::map::newest_blocks::N_FREE;
use crate::map::records::{
    BlockRecord, FrameRecord, KeyframePose, KeyframeRecord, MapChange, PoseRecord, State,
};
use crate::map::state::{KeyframeState, TrackerState};
use crate::settings::LoopSettings;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::WindowAlignment;
use tessera_geometry::{Pose, PoseBits, Twist, compose_normalised};
use tessera_graph::{Graph, INNER_ITERATIONS, Pair, PairBlock};

/// Keyframes as vertices of a graph, by the order in which their blocks name them.
struct Vertices<'a> {
    settings: &'a LoopSettings,
    frame_index: u64,
    state: &'a TrackerState,
    made: &'a KeyframeRecord,
    ids: Vec<u32>,
    graph: Graph,
}

impl Vertices<'_> {
    /// The vertex of a keyframe; `None` where it has no pose in the gauge of the camera.
    fn of(&mut self, id: u32) -> Option<usize> {
        if let Some(vertex) = self.ids.iter().position(|known| *known == id) {
            return Some(vertex);
        }
        let (pose, is_free) = if id == self.made.id {
            (&self.made.world_from_camera, true)
        } else {
            let (state, keyframe) = (self.state, self.state.keyframes.get(id as usize)?);
            if state.submaps.component(keyframe.submap) != state.submaps.component(state.submap) {
                return None;
            }
            // What was seen long ago is held: whether it is the same place is for others to judge.
            let is_old = detection::is_loop(self.settings, state, keyframe, self.frame_index);
            let is_new = !is_old && id != 0 && id + N_FREE > self.made.id;
            let is_free = is_new && keyframe.is_active() && state.is_own(keyframe);
            (&keyframe.world_from_camera, is_free)
        };
        self.ids.push(id);
        self.graph.poses.push(Pose::from(pose));
        self.graph.is_fixed.push(!is_free);
        Some(self.ids.len() - 1)
    }

    fn add(&mut self, newer: u32, block: &BlockRecord) {
        let vertices = (self.of(newer), self.of(block.keyframe));
        if let ((Some(query), Some(target)), Some(block)) = (vertices, block.pair_block()) {
            self.graph.pairs.push(Pair::new(query, target, block));
        }
    }
}

/// The record of a frame that makes a keyframe, with the newest keyframes where they and the frame agree best. Nothing
/// changes while a correction is under way, which decides, or without a solution.
pub(crate) fn smoothed(
    settings: &LoopSettings,
    state: &TrackerState,
    aligned: &WindowAlignment,
    record: FrameRecord,
) -> FrameRecord {
    let Some(made) = &record.change.new_keyframe else { return record };
    if state.pending.is_some() || aligned.state != State::Tracking {
        return record;
    }
    let frame_index = record.index;
    let mut vertices =
        Vertices { settings, frame_index, state, made, ids: Vec::new(), graph: Graph::default() };
    let became = state.recent.iter().find(|r| r.index == made.frame_index);
    let of_made = became.into_iter().flat_map(|r| r.blocks.iter().map(|block| (made.id, block)));
    state.newest_blocks.iter().chain(of_made).for_each(|(newer, block)| vertices.add(newer, block));
    let (Some(keyframe), Some(reference)) = (vertices.of(made.id), vertices.of(record.pose.keyframe)) else {
        return record;
    };
    let of_frame = aligned.members.iter().zip(&aligned.alignment.blocks);
    let of_frame: Vec<(usize, PairBlock)> = of_frame
        .filter_map(|(member, (origin, sums))| match member {
            Member::Keyframe(id) => Some((vertices.of(*id)?, PairBlock::new(origin, sums))),
            Member::Recent(_) => None,
        })
        .collect();
    let Vertices { ids, mut graph, .. } = vertices;
    // Somewhere the map is held.
    if !graph.is_fixed.contains(&true)
        && let Some(oldest) = (0..ids.len()).min_by_key(|vertex| ids[*vertex])
    {
        graph.is_fixed[oldest] = true;
    }
    let frame = graph.poses.len();
    graph.poses.push(Pose::from(&record.pose.world_from_camera));
    graph.is_fixed.push(false);
    graph.pairs.extend(of_frame.into_iter().map(|(target, block)| Pair::new(frame, target, block)));
    if graph.optimise(INNER_ITERATIONS, &mut || ()).is_err() {
        return record;
    }
    let normal = |pose: &Pose| PoseBits::from(&compose_normalised(pose, &Twist::default()));
    let free = ids.iter().zip(&graph.poses).zip(&graph.is_fixed);
    let moved = free.filter(|((id, _), is_fixed)| !**is_fixed && **id != made.id);
    let moved: Vec<KeyframePose> =
        moved.map(|((&id, pose), _)| KeyframePose { id, world_from_camera: normal(pose) }).collect();
    if moved.is_empty() {
        return record;
    }
    let world_from_camera = graph.poses[frame];
    let new_from_old = world_from_camera * Pose::from(&record.pose.world_from_camera).inverse();
    let made = KeyframeRecord { world_from_camera: normal(&graph.poses[keyframe]), ..made.clone() };
    FrameRecord {
        pose: PoseRecord {
            world_from_camera: normal(&world_from_camera),
            world_from_odom: normal(&(new_from_old * Pose::from(&record.pose.world_from_odom))),
            keyframe_from_camera: normal(&(graph.poses[reference].inverse() * world_from_camera)),
            ..record.pose
        },
        change: MapChange {
            new_keyframe: Some(made),
            moved: with_anchored(&state.keyframes, moved),
            ..record.change
        },
        ..record
    }
}

/// Keyframes that moved, and behind them the culled ones that move along with them.
fn with_anchored(keyframes: &[KeyframeState], mut moved: Vec<KeyframePose>) -> Vec<KeyframePose> {
    for k in 0..moved.len() {
        let KeyframePose { id, world_from_camera } = moved[k];
        let Some(anchor) = keyframes.get(id as usize) else { continue };
        let new_from_old = Pose::from(&world_from_camera) * Pose::from(&anchor.world_from_camera).inverse();
        moved.extend(keyframes.iter().filter(|k| k.anchored_to == Some(id)).map(|k| {
            let pose = new_from_old * Pose::from(&k.world_from_camera);
            let pose = compose_normalised(&pose, &Twist::default());
            KeyframePose { id: k.id, world_from_camera: PoseBits::from(&pose) }
        }));
    }
    moved
}
