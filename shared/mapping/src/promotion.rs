//! The previous frame becomes a keyframe and the alignment is repeated (SPEC 9); what follows.

use crate::attempt::Attempt;
use crate::budget;
use crate::judge;
use crate::keyframes::{self, Distance};
use crate::loops;
use crate::records::{EdgeRecord, FrameRecord, KeyframeRecord, State, StoreSlot};
use crate::state::{KeyframeState, RecentFrame};
use crate::tracker::{FrameSurface, Surfaces, Tracker};
use crate::window::Member;
use tessera_geometry::{Pose, log};
use tessera_recognition::similarity;
use tessera_registration::Sample;

impl Tracker {
    /// The previous frame as a keyframe, when the new one is too far from the last (SPEC 9.1).
    pub(crate) fn promote(
        &self,
        frame: &FrameSurface<'_>,
        record: &FrameRecord,
        surfaces: &Surfaces<'_>,
    ) -> Option<KeyframeRecord> {
        let last_keyframe = self.state.keyframes.last()?;
        let previous = self.state.recent.last()?;
        let distance = Distance {
            keyframe_from_camera: &Pose::from(&record.keyframe_from_camera),
            entropy_nats: record.entropy_nats,
            reference_entropy: self.state.reference_entropy,
            n_frames: self.state.frames_since_keyframe,
        };
        let surface = surfaces.recent.iter().find(|s| s.index == previous.index)?;
        if (self.state.is_own(last_keyframe) && previous.index == last_keyframe.frame_index)
            || previous.state != State::Tracking
            || !keyframes::is_due(&self.context.mapping.keyframe, &distance)
        {
            return None;
        }
        Some(KeyframeRecord {
            id: last_keyframe.id + 1,
            frame_index: previous.index,
            stamp_nanos: previous.stamp_nanos,
            world_from_camera: previous.world_from_camera,
            velocity: self.central_velocity(previous, frame, &Pose::from(&record.world_from_camera)),
            slot: StoreSlot::default(),
            edges: Vec::new(),
            place: self.ferns.code(&surface.surface),
            retires: budget::spared(&self.state, &self.context.mapping),
        })
    }

    /// Motion of the previous frame from its neighbours on both sides.
    fn central_velocity(
        &self,
        previous: &RecentFrame,
        frame: &FrameSurface<'_>,
        world_from_camera: &Pose,
    ) -> [f64; 6] {
        let before = match self.state.recent.as_slice() {
            [before, _] if before.state == State::Tracking => before,
            _ => previous,
        };
        let seconds = (frame.stamp_nanos - before.stamp_nanos) as f64 * 1e-9;
        if !(seconds > 0.0 && seconds < 1.0) {
            return previous.velocity;
        }
        let step = log(&(Pose::from(&before.world_from_camera).inverse() * world_from_camera));
        step.scaled(1.0 / seconds).to_vector().into()
    }

    /// The alignment repeated with the new keyframe in the window; one promotion per frame.
    pub(crate) fn realign(
        &mut self,
        frame: &FrameSurface<'_>,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        first: &Attempt,
        record: FrameRecord,
        keyframe: KeyframeRecord,
    ) -> (Attempt, FrameRecord) {
        self.state.keyframes.push(KeyframeState {
            id: keyframe.id,
            session: self.state.session,
            frame_index: keyframe.frame_index,
            stamp_nanos: keyframe.stamp_nanos,
            world_from_camera: keyframe.world_from_camera,
            velocity: keyframe.velocity,
            slot: keyframe.slot,
            edges: Vec::new(),
            covariance: self.state.recent.last().map_or(Vec::new(), |r| r.covariance.clone()),
            place: Vec::new(),
            hangs_on: None,
        });
        let mut prediction = self.predict(frame);
        prediction.world_from_camera = first.alignment.world_from_camera;
        prediction.velocity = first.alignment.velocity;
        prediction.first_distance_m = self.context.mapping.window.min_first_distance_m;
        // It starts at a solution: once with wide limits, once with the last.
        prediction.outer_iterations = 2;
        let second = self.attempt(samples, surfaces, &prediction);
        let result = if judge::tracking(&self.context.mapping.window, &second.alignment).is_ok() {
            let mut keyframe = keyframe;
            keyframe.edges = self.edges(frame, &second);
            let record = self.record(frame, &second, Some(keyframe));
            (second, record)
        } else {
            // The first alignment stands, hung on the keyframe it was made with.
            (first.clone(), FrameRecord { new_keyframe: Some(keyframe), ..record })
        };
        self.state.keyframes.pop();
        result
    }

    fn edges(&self, frame: &FrameSurface<'_>, attempt: &Attempt) -> Vec<EdgeRecord> {
        let newest = self.state.keyframes.last().map_or(0, |k| k.id);
        let mut edges: Vec<EdgeRecord> = attempt
            .members
            .iter()
            .filter_map(|m| match m {
                Member::Keyframe(id) if *id != newest => self.state.keyframes.get(*id as usize),
                _ => None,
            })
            .map(|k| EdgeRecord {
                to: k.id,
                is_loop: loops::is_loop(
                    &self.context.mapping.loops,
                    &self.state,
                    k,
                    frame.index,
                    frame.stamp_nanos,
                ),
            })
            .collect();
        edges.sort_by_key(|e| e.to);
        edges
    }

    /// Asks for an optimisation when the window holds poses acquired long ago.
    pub(crate) fn with_request(
        &self,
        frame: &FrameSurface<'_>,
        attempt: &Attempt,
        mut record: FrameRecord,
    ) -> FrameRecord {
        let settings = &self.context.mapping.loops;
        let sees_loop =
            attempt.members.iter().any(|m| match m {
                Member::Keyframe(id) => self.state.keyframes.get(*id as usize).is_some_and(|k| {
                    loops::is_loop(settings, &self.state, k, frame.index, frame.stamp_nanos)
                }),
                Member::Recent(_) => false,
            });
        let looks_known = || record.new_keyframe.as_ref().is_some_and(|k| self.looks_known(k));
        if sees_loop || looks_known() {
            let n_keyframes = self.state.keyframes.len() as u32 + u32::from(record.new_keyframe.is_some());
            let is_urgent = !record.moved.is_empty();
            record.request = loops::request(settings, &self.state, frame.index, n_keyframes, is_urgent);
        }
        record
    }

    /// Whether a new keyframe looks like one that could close a loop: the optimiser will see.
    fn looks_known(&self, keyframe: &KeyframeRecord) -> bool {
        let settings = &self.context.mapping.loops;
        self.state.keyframes.iter().any(|older| {
            older.is_active()
                && loops::is_loop(settings, &self.state, older, keyframe.frame_index, keyframe.stamp_nanos)
                && similarity(&keyframe.place, &older.place) >= settings.min_similarity
        })
    }
}
