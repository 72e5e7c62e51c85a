//! State of the tracker between two frames, as a fold over its journal.

use crate::estimation::colour_model::{ColourModel, ColourState};
use crate::estimation::motion_filter::MotionState;
use crate::estimation::noise_scales::NoiseState;
use crate::map::active_ids::ActiveIds;
pub(crate) use crate::map::keyframe::KeyframeState;
use crate::map::keyframe::RetiredRecord;
use crate::map::newest_blocks::NewestBlocks;
use crate::map::placement::{RigidMotion, apply_correction, apply_join, apply_poses};
use crate::map::placement::{apply_retired, apply_split};
use crate::map::records::{
    AlignRecord, AppliedCorrection, BlockRecord, ContradictionRecord, FrameRecord, JoinRecord, MapRecord,
    RequestRecord, SightingRecord, SplitRecord, State,
};
use crate::map::submaps::Submaps;
use serde::{Deserialize, Serialize};
use tessera_geometry::{Camera, InertialRotation, Pose, PoseBits, UpDirection, log};

/// Longest time between two frames that are one run of the camera, seconds: beyond it the velocity is not used.
pub(crate) const MOST_COASTED_S: f64 = 1.0;

/// One of the last frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecentFrame {
    /// Frame index.
    pub index: u64,
    /// Its stamp.
    pub stamp_nanos: i64,
    /// Whether it was tracked.
    pub state: State,
    /// Its pose in the map as corrected so far.
    pub world_from_camera: PoseBits,
    /// Its own motion per second, `rho phi`.
    pub velocity: [f64; 6],
    /// Covariance of its pose, as in [`PoseRecord::covariance`](crate::PoseRecord::covariance).
    pub covariance: Vec<f64>,
    /// As in [`FrameRecord::repeats_colour`].
    pub repeats_colour: bool,
    /// As in [`PoseRecord::rotation`](crate::PoseRecord::rotation).
    pub rotation: Option<InertialRotation>,
    /// As in [`EvidenceRecord::up`](crate::EvidenceRecord::up).
    pub up: Option<UpDirection>,
    /// As in [`EvidenceRecord::blocks`](crate::EvidenceRecord::blocks).
    pub blocks: Vec<BlockRecord>,
}

/// Everything that tracking needs of the past beside surfaces.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TrackerState {
    /// The next index to align.
    pub next_index: u64,
    /// This run among those that made the map; 0: it began the map.
    pub session: u32,
    /// Keyframes of earlier runs.
    pub n_map_keyframes: u32,
    /// Pose of the camera in the map of earlier runs at the first frame, if it was given.
    pub start: Option<PoseBits>,
    /// A frame of this run has been tracked: before, its place in the map is unknown.
    pub is_placed: bool,
    /// All keyframes, by id.
    pub keyframes: Vec<KeyframeState>,
    /// Pair blocks of the newest keyframes with older ones.
    pub newest_blocks: NewestBlocks,
    /// The submap in which the camera is.
    pub submap: u32,
    /// Which submaps are joined.
    pub submaps: Submaps,
    /// A place of another submap that the camera is thought to see.
    pub sighting: Option<SightingRecord>,
    /// Joins that were refused or refuted, and the number of keyframes from which on each may be tried again.
    pub refused: Vec<(JoinRecord, u32)>,
    /// As in [`MapChange::contradiction`](crate::MapChange::contradiction).
    pub contradiction: Option<ContradictionRecord>,
    /// The last two frames, newest last.
    pub recent: Vec<RecentFrame>,
    /// Motion by all corrections so far; identity before the first.
    pub world_from_odom: Option<PoseBits>,
    /// Entropy of the first frame aligned to the last keyframe, nats.
    pub reference_entropy: Option<f64>,
    /// Frames since the last keyframe was made.
    pub frames_since_keyframe: u32,
    /// The request without an effect yet.
    pub pending: Option<RequestRecord>,
    /// Requests made.
    pub n_requests: u64,
    /// Keyframes that took part in the last request.
    pub n_keyframes_at_request: u32,
    /// Frames lost in a row.
    pub n_lost: u32,
    /// As in [`FrameRecord::lost_nanos`].
    pub lost_nanos: i64,
    /// Lost since relocalisation was asked for: the last pose is no place to look at.
    pub is_pose_dropped: bool,
    /// As in [`FrameRecord::evidence_nats`].
    pub evidence_nats: f64,
    /// Colour model estimated from all frames.
    pub colour: ColourState,
    /// Noise scales of surfaces and features.
    pub noise: NoiseState,
    /// The camera's velocity and how much it changes.
    pub motion: MotionState,
    /// The source is exhausted.
    pub is_ended: bool,
    /// Ids of the active keyframes.
    #[serde(skip)]
    pub(crate) active_ids: ActiveIds,
}

impl TrackerState {
    /// The state before the first frame of a camera.
    pub(crate) fn of_camera(camera: &Camera) -> Self {
        Self { colour: ColourState::stated(ColourModel::of_camera(camera)), ..Self::default() }
    }

    /// Takes one record in. The only way the state changes, live and in replay.
    pub fn apply(&mut self, record: &AlignRecord) {
        match record {
            AlignRecord::Frame(frame) => self.apply_frame(frame),
            AlignRecord::Map(map) => self.apply_map(map),
            AlignRecord::Skipped(skipped) => self.next_index = self.next_index.max(skipped.frames.end),
            AlignRecord::Correction(applied) => self.apply_correction(applied),
            AlignRecord::End { request, .. } => {
                self.is_ended = true;
                if let Some(request) = request {
                    self.note_request(request);
                }
            }
        }
    }

    /// Keyframes to which others may be aligned, by id: without a look at those that were culled, which
    /// are most of them in a long run.
    pub(crate) fn active(&self) -> impl Iterator<Item = &KeyframeState> {
        self.active_ids.of(&self.keyframes)
    }

    /// A keyframe that this run made.
    pub(crate) fn is_own(&self, keyframe: &KeyframeState) -> bool {
        keyframe.session == self.session
    }

    fn apply_map(&mut self, map: &MapRecord) {
        self.session = map.keyframes.iter().map(|k| k.session.saturating_add(1)).max().unwrap_or(0);
        self.n_map_keyframes = map.keyframes.len() as u32;
        // The map is optimised again only once it has grown.
        self.n_keyframes_at_request = self.n_map_keyframes;
        self.keyframes.clone_from(&map.keyframes);
        self.active_ids = ActiveIds::default();
        self.submaps.clone_from(&map.submaps);
        self.submap = map.keyframes.last().map_or(0, |k| k.submap);
        self.start = map.start;
    }

    fn apply_frame(&mut self, frame: &FrameRecord) {
        self.next_index = frame.index.saturating_add(1);
        self.frames_since_keyframe = self.frames_since_keyframe.saturating_add(1);
        self.apply_moved(frame);
        self.enter(frame.submap);
        if let Some(keyframe) = &frame.change.new_keyframe {
            let became = self.recent.iter().find(|r| r.index == keyframe.frame_index);
            self.newest_blocks.add(keyframe, became.map_or(&[], |r| &r.blocks));
            let covariance = became.map_or(Vec::new(), |r| r.covariance.clone());
            // The first one of a submap is the frame itself.
            let up = became.map_or(frame.evidence.up, |r| r.up);
            let made = KeyframeState::made(keyframe, self.session, frame.submap);
            self.keyframes.push(KeyframeState { covariance, up, ..made });
            self.active_ids.extend(&self.keyframes);
            keyframe.retires.iter().for_each(|retired| self.retire(retired));
            self.frames_since_keyframe = u32::from(keyframe.frame_index < frame.index);
            self.reference_entropy = None;
        }
        if self.reference_entropy.is_none() && frame.pose.entropy_nats.is_finite() {
            self.reference_entropy = Some(frame.pose.entropy_nats);
        }
        self.colour.apply(frame.evidence.of_camera());
        if let Some(noise) = &frame.evidence.noise {
            self.noise.apply(noise);
        }
        self.follow_motion(frame);
        self.is_placed |= frame.state == State::Tracking;
        self.n_lost = if frame.state == State::Lost { self.n_lost + 1 } else { 0 };
        self.lost_nanos = frame.lost_nanos;
        let is_dropped = self.is_pose_dropped || frame.is_relocalisation_asked();
        self.is_pose_dropped = frame.state == State::Lost && is_dropped;
        self.evidence_nats = frame.evidence_nats;
        self.world_from_odom.get_or_insert(PoseBits::IDENTITY);
        self.remember(frame);
        self.sighting = frame.change.sighting;
        self.contradiction = frame.change.contradiction;
        if let Some(split) = &frame.change.split {
            self.apply_split(split, frame.submap);
        }
        if let Some(refused) = frame.change.refused {
            self.refuse(refused);
        }
        if let Some(join) = &frame.change.join {
            self.apply_join(join);
        }
        if let Some(request) = &frame.change.request {
            self.note_request(request);
        }
    }

    /// The motion from the frame before to this one.
    fn follow_motion(&mut self, frame: &FrameRecord) {
        let Some(last) = self.recent.last() else { return };
        let seconds = frame.stamp_nanos.saturating_sub(last.stamp_nanos) as f64 * 1e-9;
        let is_measured = frame.state == State::Tracking && last.state != State::Relocalising;
        match &frame.evidence.noise {
            _ if !(seconds > 0.0 && seconds < MOST_COASTED_S) => self.motion.forget(),
            Some(noise) if is_measured => {
                let [before, after] =
                    [&last.world_from_camera, &frame.pose.world_from_camera].map(Pose::from);
                let step = log(&(before.inverse() * after)).to_vector();
                self.motion.apply(&step, noise.step_variance.as_ref(), seconds);
            }
            None if frame.state == State::Lost => self.motion.coast(seconds),
            _ => self.motion.forget(),
        }
    }

    /// The last two frames, from which the next is predicted.
    fn remember(&mut self, frame: &FrameRecord) {
        if self.recent.len() == 2 {
            self.recent.remove(0);
        }
        self.recent.push(RecentFrame {
            index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            state: frame.state,
            world_from_camera: frame.pose.world_from_camera,
            velocity: frame.pose.velocity,
            covariance: frame.pose.covariance.clone(),
            repeats_colour: frame.evidence.repeats_colour,
            rotation: frame.pose.rotation,
            up: frame.evidence.up,
            blocks: frame.evidence.blocks.clone(),
        });
    }

    /// The camera is in this submap from now on, which may be a new one.
    fn enter(&mut self, submap: u32) {
        self.submaps.extend_to(submap);
        if self.submaps.component(submap) != self.submaps.component(self.submap) {
            self.reference_entropy = None;
        }
        self.submap = submap;
    }

    /// The camera turned out to have left its submap: what it saw since is of new ones, which are not where
    /// the map had them.
    fn apply_split(&mut self, split: &SplitRecord, submap: u32) {
        let first = split.firsts().next().unwrap_or(split.first) as usize;
        let left = self.keyframes.get(first).map_or(0, |k| k.submap);
        apply_split(&mut self.keyframes, split, submap);
        self.active_ids = ActiveIds::default();
        self.active_ids.extend(&self.keyframes);
        for new in submap.saturating_sub(split.firsts().count() as u32 - 1)..=submap {
            let (kept, kept_from_moved) = (self.submaps.component(left), PoseBits::IDENTITY);
            self.refuse(JoinRecord { kept, moved: self.submaps.component(new), kept_from_moved });
        }
    }

    /// The join is not tried again before as many keyframes were made as both components have in the working map:
    /// with fewer, most that tells for or against it was asked already.
    fn refuse(&mut self, join: JoinRecord) {
        let n = self.keyframes.len() as u32;
        self.refused.retain(|(_, from)| *from > n);
        let is_of_both =
            |k: &&KeyframeState| [join.kept, join.moved].contains(&self.submaps.component(k.submap));
        let n_asked = self.active().filter(is_of_both).count() as u32;
        self.refused.push((join, n.saturating_add(n_asked)));
    }

    /// Two components become one; where the camera's is the one that moves, `world_from_odom` goes
    /// along, so that `odom_from_camera` does not jump.
    fn apply_join(&mut self, join: &JoinRecord) {
        let is_moved = self.submaps.component(self.submap) == join.moved;
        let motion = apply_join(&mut self.keyframes, &mut self.submaps, join);
        if is_moved {
            self.move_camera(&motion);
        }
    }

    fn move_camera(&mut self, motion: &RigidMotion) {
        for frame in &mut self.recent {
            frame.world_from_camera = motion.of(&frame.world_from_camera);
        }
        self.world_from_odom = Some(motion.of(&self.world_from_odom.unwrap_or(PoseBits::IDENTITY)));
    }

    /// A keyframe leaves the working map, with all that is of use there alone.
    pub fn retire(&mut self, retired: &RetiredRecord) {
        apply_retired(&mut self.keyframes, retired);
        for id in self.keyframes.iter_mut().flat_map(|keyframe| &mut keyframe.alike) {
            *id = if *id == retired.keyframe { retired.anchored_to } else { *id };
        }
        if let Some(keyframe) = self.keyframes.get_mut(retired.keyframe as usize) {
            (keyframe.edges, keyframe.covariance) = Default::default();
            (keyframe.place, keyframe.alike) = Default::default();
            self.active_ids.remove(retired.keyframe);
        }
    }

    /// Keyframes that moved with a new one; the frames before this one move along with it.
    fn apply_moved(&mut self, frame: &FrameRecord) {
        if frame.change.moved.is_empty() {
            return;
        }
        apply_poses(&mut self.keyframes, &frame.change.moved);
        let before = self.world_from_odom.unwrap_or(PoseBits::IDENTITY);
        let motion = RigidMotion::between(&before, &frame.pose.world_from_odom);
        for recent in &mut self.recent {
            recent.world_from_camera = motion.of(&recent.world_from_camera);
        }
        self.world_from_odom = Some(frame.pose.world_from_odom);
    }

    fn note_request(&mut self, request: &RequestRecord) {
        self.pending = Some(*request);
        self.n_requests = request.request.saturating_add(1);
        self.n_keyframes_at_request = request.n_keyframes;
    }

    /// Keyframes move by [`apply_correction`], and `world_from_odom` with what came after them, so that
    /// `odom_from_camera` does not jump.
    fn apply_correction(&mut self, applied: &AppliedCorrection) {
        self.pending = None;
        let Some(motions) = apply_correction(&mut self.keyframes, &applied.correction) else {
            return;
        };
        if let Some(motion) = motions.get(&self.submap) {
            self.move_camera(motion);
        }
        let before = self.submaps.clone();
        self.submaps.judge(&applied.correction.submaps);
        // What comes apart has the gauge in which it was joined.
        for moved in self.submaps.apart_since(&before) {
            let (kept, kept_from_moved) = (before.component(moved), PoseBits::IDENTITY);
            self.refuse(JoinRecord { kept, moved, kept_from_moved });
        }
    }
}
