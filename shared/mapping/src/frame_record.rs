//! From an alignment to the record of its frame.

use crate::alignment::Prediction;
use crate::attempt::Attempt;
use crate::covariance::{self, upper_triangle};
use crate::degeneracy::describe;
use crate::records::{BlockRecord, FrameRecord, KeyframeRecord, State, StoreSlot};
use crate::tracker::{FrameSurface, Tracker};
use crate::window::Member;
use tessera_geometry::{Matrix6, Pose, PoseBits};
use tessera_registration::{PairBlock, entropy_of_covariance, metric_covariance};

/// No keyframe yet.
const NO_KEYFRAME: u32 = u32::MAX;

/// What there is to say about an attempt that stands.
fn reason(attempt: &Attempt) -> String {
    let free = &attempt.alignment.free;
    let parts = [attempt.reason.clone(), if free.is_empty() { String::new() } else { describe(free) }];
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ")
}

impl Tracker {
    pub(crate) fn record(
        &self,
        frame: &FrameSurface<'_>,
        attempt: &Attempt,
        new_keyframe: Option<KeyframeRecord>,
    ) -> FrameRecord {
        let a = &attempt.alignment;
        let last_keyframe = self.state.keyframes.last();
        let keyframe_pose = last_keyframe.map_or(Pose::identity(), |k| Pose::from(&k.world_from_camera));
        let factor = self.aligner.metric_factor(&self.context);
        // A map with a budget keeps nothing for each frame.
        let is_kept = self.context.mapping.keyframe.budget == 0;
        let blocks: Vec<BlockRecord> = attempt
            .members
            .iter()
            .zip(&a.blocks)
            .filter(|_| is_kept)
            .filter_map(|(member, (origin, sums))| match member {
                Member::Keyframe(keyframe) => Some(BlockRecord {
                    keyframe: *keyframe,
                    keyframe_from_camera: PoseBits::from(origin),
                    sums: sums.to_numbers(),
                    n_matches: sums.n,
                }),
                Member::Recent(_) => None,
            })
            .collect();
        let entropy_nats = attempt
            .members
            .iter()
            .position(|m| last_keyframe.is_some_and(|k| *m == Member::Keyframe(k.id)))
            .and_then(|place| {
                let (origin, sums) = &a.blocks[place];
                let now = keyframe_pose.inverse() * a.world_from_camera;
                entropy_of_covariance(
                    &PairBlock::new(origin, sums).linearise(&now).0,
                    self.aligner.independent_factor(),
                )
            })
            .unwrap_or(f64::NAN);
        FrameRecord {
            index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            effort: frame.effort,
            state: attempt.state,
            reason: reason(attempt),
            world_from_camera: PoseBits::from(&a.world_from_camera),
            world_from_odom: self.state.world_from_odom.unwrap_or(PoseBits::IDENTITY),
            keyframe: last_keyframe.map_or(NO_KEYFRAME, |k| k.id),
            keyframe_from_camera: PoseBits::from(&(keyframe_pose.inverse() * a.world_from_camera)),
            covariance: metric_covariance(&a.information, factor).map_or(Vec::new(), |own| {
                let w = &self.context.mapping.window;
                upper_triangle(&covariance::of_world(w, &self.state, attempt, &own, frame.index))
            }),
            n_correspondences: a.n_matches(),
            velocity: a.velocity.to_vector().into(),
            rotation: frame.rotation,
            entropy_nats,
            blocks,
            moved: Vec::new(),
            new_keyframe,
            request: None,
        }
    }

    /// The first frame with enough points: the map's origin and its first keyframe.
    pub(crate) fn first(&self, frame: &FrameSurface<'_>, prediction: &Prediction) -> FrameRecord {
        let bits = PoseBits::from(&prediction.world_from_camera);
        let keyframe = KeyframeRecord {
            id: 0,
            frame_index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            world_from_camera: bits,
            velocity: [0.0; 6],
            slot: StoreSlot::default(),
            edges: Vec::new(),
            place: self.ferns.code(&frame.surface),
            retires: Vec::new(),
        };
        FrameRecord {
            state: State::Tracking,
            reason: "the first frame".into(),
            keyframe: 0,
            keyframe_from_camera: PoseBits::IDENTITY,
            covariance: upper_triangle(&Matrix6::zeros()),
            new_keyframe: Some(keyframe),
            ..self.lost(frame, prediction, String::new())
        }
    }

    /// A frame that could not be aligned holds the prediction and changes nothing.
    pub(crate) fn lost(
        &self,
        frame: &FrameSurface<'_>,
        prediction: &Prediction,
        reason: String,
    ) -> FrameRecord {
        let keyframe = self.state.keyframes.last();
        let keyframe_pose = keyframe.map_or(Pose::identity(), |k| Pose::from(&k.world_from_camera));
        FrameRecord {
            index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            effort: frame.effort,
            state: State::Lost,
            reason,
            world_from_camera: PoseBits::from(&prediction.world_from_camera),
            world_from_odom: self.state.world_from_odom.unwrap_or(PoseBits::IDENTITY),
            keyframe: keyframe.map_or(NO_KEYFRAME, |k| k.id),
            keyframe_from_camera: PoseBits::from(&(keyframe_pose.inverse() * prediction.world_from_camera)),
            covariance: Vec::new(),
            n_correspondences: 0,
            velocity: [0.0; 6],
            rotation: frame.rotation,
            entropy_nats: f64::NAN,
            blocks: Vec::new(),
            moved: Vec::new(),
            new_keyframe: None,
            request: None,
        }
    }
}
