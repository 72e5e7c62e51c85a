//! A conflict at a loop closure (III-G; method 7): the window's old poses contradict its recent ones,
//! and the extended window decides.

use crate::loops::detection;
use crate::map::records::{FrameRecord, KeyframePose, KeyframeRecord, State};
use crate::map::state::KeyframeState;
use crate::tracking::input::{FrameSurface, Surfaces};
use crate::tracking::tracker::Tracker;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::WindowAlignment;
use tessera_geometry::{Pose, PoseBits, Twist, compose_normalised, translation_rotation_norms};
use tessera_graph::{Graph, INNER_ITERATIONS, Pair, PairBlock};
use tessera_registration::Sample;

impl Tracker {
    /// How far the frame is from where it would be without the keyframes that close a loop: metres
    /// and radians. `None` where the window holds no loop, or nothing else.
    fn conflict(
        &self,
        frame: &FrameSurface<'_>,
        attempt: &WindowAlignment,
        record: &FrameRecord,
    ) -> Option<(f64, f64)> {
        let settings = &self.context.mapping.loops;
        let is_old = |member: &Member| match member {
            Member::Keyframe(id) => self
                .state
                .keyframes
                .get(*id as usize)
                .is_some_and(|k| detection::is_loop(settings, &self.state, k, frame.index)),
            Member::Recent(_) => false,
        };
        let n_old = attempt.members.iter().filter(|m| is_old(m)).count();
        if n_old == 0 || n_old == attempt.members.len() || attempt.state != State::Tracking {
            return None;
        }
        let with = attempt.alignment.world_from_camera;
        let mut graph = Graph { poses: vec![with], is_fixed: vec![false], ..Graph::default() };
        for (member, (origin, sums)) in attempt.members.iter().zip(&attempt.alignment.blocks) {
            if !is_old(member) {
                graph.poses.push(self.member_pose(*member, record)?);
                graph.is_fixed.push(true);
                let target = graph.poses.len() - 1;
                graph.pairs.push(Pair::new(0, target, PairBlock::new(origin, sums)));
            }
        }
        graph.optimise(INNER_ITERATIONS, &mut || ()).ok()?;
        Some(translation_rotation_norms(&(graph.poses[0].inverse() * with)))
    }

    fn member_pose(&self, member: Member, record: &FrameRecord) -> Option<Pose> {
        match member {
            Member::Recent(place) => self.state.recent.get(place).map(|r| Pose::from(&r.world_from_camera)),
            Member::Keyframe(id) => {
                let known = self.state.keyframes.get(id as usize).map(|k| &k.world_from_camera);
                let made = record.new_keyframe.as_ref().filter(|k| k.id == id).map(|k| &k.world_from_camera);
                known.or(made).map(Pose::from)
            }
        }
    }

    /// The record of a frame whose window contradicts itself: the frame and the window's keyframes
    /// solved for at once. Nothing changes without a conflict, while a correction is under way (it
    /// decides), or without a solution.
    pub(crate) fn settled(
        &self,
        frame: &FrameSurface<'_>,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        attempt: &WindowAlignment,
        record: FrameRecord,
    ) -> FrameRecord {
        let settings = &self.context.mapping.loops;
        // One attempt for each keyframe: a conflict that stays is the optimiser's.
        let is_new = self.state.keyframes.len() as u32 > self.state.n_keyframes_at_request;
        if self.state.pending.is_some() || !is_new || !settings.extended_window {
            return record;
        }
        let Some(jump @ (jump_m, jump_rad)) = self.conflict(frame, attempt, &record) else { return record };
        if jump_m <= settings.conflict_translation_m
            && jump_rad <= settings.conflict_rotation_deg.to_radians()
        {
            return record;
        }
        let window = self.extended_window(attempt, surfaces);
        let Some(poses) = self.solve_extended(samples, attempt, &window) else { return record };
        let Some((world_from_camera, keyframe_poses)) = poses.split_last() else { return record };
        let moved: Vec<KeyframePose> = window
            .iter()
            .zip(keyframe_poses)
            .filter(|(v, _)| !v.is_fixed)
            .map(|(v, pose)| KeyframePose { id: v.id, world_from_camera: PoseBits::from(pose) })
            .collect();
        if moved.is_empty() {
            return record;
        }
        self.with_moved(record, world_from_camera, moved, jump)
    }

    /// The record of a frame that came to lie elsewhere, and with it the keyframes `moved`.
    fn with_moved(
        &self,
        record: FrameRecord,
        world_from_camera: &Pose,
        moved: Vec<KeyframePose>,
        (jump_m, jump_rad): (f64, f64),
    ) -> FrameRecord {
        let n_moved = moved.len();
        let moved = with_anchored(&self.state.keyframes, moved);
        let normal = |pose: &Pose| PoseBits::from(&compose_normalised(pose, &Twist::default()));
        let new_from_old = world_from_camera * Pose::from(&record.world_from_camera).inverse();
        let world_from_odom = new_from_old * Pose::from(&record.world_from_odom);
        // A keyframe made just now goes with the frame.
        let new_keyframe = record.new_keyframe.clone().map(|keyframe| KeyframeRecord {
            world_from_camera: normal(&(new_from_old * Pose::from(&keyframe.world_from_camera))),
            ..keyframe
        });
        let pose_of = |id: u32| {
            let moved = moved.iter().find(|k| k.id == id).map(|k| &k.world_from_camera);
            let made = new_keyframe.as_ref().filter(|k| k.id == id).map(|k| &k.world_from_camera);
            let known = self.state.keyframes.get(id as usize).map(|k| &k.world_from_camera);
            moved.or(made).or(known).map(Pose::from)
        };
        let Some(world_from_keyframe) = pose_of(record.keyframe) else { return record };
        let said = format!(
            "a conflict of {jump_m:.3} m and {:.2} deg with keyframes of long ago; {} moved",
            jump_rad.to_degrees(),
            n_moved
        );
        FrameRecord {
            reason: if record.reason.is_empty() { said } else { format!("{}; {said}", record.reason) },
            world_from_camera: normal(world_from_camera),
            world_from_odom: normal(&world_from_odom),
            keyframe_from_camera: normal(&(world_from_keyframe.inverse() * world_from_camera)),
            new_keyframe,
            moved,
            ..record
        }
    }
}

/// Keyframes that moved, and behind them the culled ones that move along with them.
pub(crate) fn with_anchored(keyframes: &[KeyframeState], mut moved: Vec<KeyframePose>) -> Vec<KeyframePose> {
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
