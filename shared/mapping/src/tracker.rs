//! The aligner's pure step: a frame's surface in, its record out.

use crate::alignment::{Aligner, Prediction};
use crate::attempt::Attempt;
use crate::context::Context;
use crate::effort::FullEffort;
use crate::optimiser::input_hash;
use crate::records::{AlignRecord, AppliedCorrection, Correction, FrameRecord, RequestRecord, State};
use crate::state::{RecentFrame, TrackerState};
use nalgebra::Vector3;
use tessera_geometry::{
    InertialRotation, Pose, RelativeRotation, Twist, Vector6, compose_normalised, exp,
    translation_rotation_norms,
};
use tessera_recognition::Ferns;
use tessera_registration::{Sample, Sampler};
use tessera_steps::Step;
use tessera_surface::{Effort, SurfaceView, Vertex};

/// A frame's surface with its identity.
#[derive(Clone, Copy, Debug)]
pub struct FrameSurface<'a> {
    /// Frame index as the source counts.
    pub index: u64,
    /// Sensor time.
    pub stamp_nanos: i64,
    /// The camera's rotation since the source's first frame, where a gyroscope measured it.
    pub rotation: Option<InertialRotation>,
    /// The surface, read in place.
    pub surface: SurfaceView<'a>,
    /// How much work it gets; the same in each replay.
    pub effort: Effort,
}

/// Read access to the surfaces of keyframes, in place.
pub trait KeyframeSurfaces: Sync {
    /// Vertices of a keyframe, row by row; the grid is the same for all.
    fn vertices(&self, keyframe: u32) -> &[Vertex];
}

/// Fewer samples than this cannot be aligned.
const MIN_SAMPLES: usize = 100;
/// Frames in a row without enough points through which the motion before them is believed.
const MOST_COASTED: u32 = 10;

/// A rotation known worse than this is worse than constant velocity, radians.
const MOST_INERTIAL_SIGMA_RAD: f64 = 0.1;

/// The aligner: a fold over [`AlignRecord`]s plus a pure step that makes the next one.
pub struct Tracker {
    pub(crate) context: Context,
    pub(crate) state: TrackerState,
    pub(crate) aligner: Aligner,
    pub(crate) ferns: Ferns,
    full_effort: FullEffort,
    sampler: Sampler,
    samples: Vec<Sample>,
}

/// Surfaces that one step may read.
pub(crate) struct Surfaces<'a> {
    pub(crate) recent: &'a [FrameSurface<'a>],
    pub(crate) keyframes: &'a dyn KeyframeSurfaces,
}

impl Tracker {
    /// A tracker that has seen nothing.
    pub fn new(context: Context) -> Self {
        let aligner = Aligner::new(&context);
        Self {
            full_effort: FullEffort::of(&context),
            context,
            state: TrackerState::default(),
            aligner,
            ferns: Ferns::default(),
            sampler: Sampler::default(),
            samples: Vec::new(),
        }
    }

    /// A tracker that goes on from a state, as one that took in all records before it.
    pub fn restore(context: Context, state: TrackerState) -> Self {
        Self { state, ..Self::new(context) }
    }

    /// Takes a record into the state. The only way the state changes, live and in replay.
    pub fn apply(&mut self, record: &AlignRecord) {
        self.state.apply(record);
    }

    /// The state as of the records taken in.
    pub fn state(&self) -> &TrackerState {
        &self.state
    }

    /// The index that must be aligned next (lossless), or the lowest acceptable (live).
    pub fn next_index(&self) -> u64 {
        self.state.next_index
    }

    /// Surfaces of frames from this index on are needed beside the keyframes' to align `next_index`.
    pub fn first_recent_index(&self) -> u64 {
        self.state.recent.last().map_or(self.state.next_index, |r| r.index)
    }

    /// The request whose correction must be applied before frame `index` is aligned.
    pub fn correction_due(&self, index: u64) -> Option<u64> {
        self.state.pending.filter(|p| index >= p.effective_before).map(|p| p.request)
    }

    /// The request that has no effect yet.
    pub fn pending_request(&self) -> Option<RequestRecord> {
        self.state.pending
    }

    /// The record by which a correction takes effect before `before_frame`; `None` when it does
    /// not answer the pending request or was computed from another input.
    pub fn correction_record(&self, correction: Correction, before_frame: u64) -> Option<AlignRecord> {
        let pending = self.state.pending?;
        let n = (pending.n_keyframes as usize).min(self.state.keyframes.len());
        let is_answer = correction.request == pending.request
            && correction.input_hash == input_hash(&self.state.keyframes[..n])
            && correction.keyframes.iter().all(|k| k.world_from_camera.is_valid());
        is_answer.then(|| AlignRecord::Correction(Box::new(AppliedCorrection { before_frame, correction })))
    }

    /// The final request once the source is exhausted; `None` with fewer than two keyframes, or
    /// where the map of an earlier run has not grown.
    pub fn final_request(&self) -> Option<RequestRecord> {
        let n_keyframes = self.state.keyframes.len() as u32;
        (n_keyframes >= 2 && n_keyframes > self.state.n_map_keyframes).then_some(RequestRecord {
            request: self.state.n_requests,
            n_keyframes,
            effective_before: self.state.next_index,
            is_final: true,
        })
    }

    /// Aligns a frame. `recent` holds the surfaces from [`Self::first_recent_index`] on that the
    /// shell still has, in order of index. A `new_keyframe` in the answer has an empty store slot:
    /// the shell writes that frame's surface to the store and fills the slot in before it journals.
    ///
    /// The state does not change: the answer takes effect through [`Self::apply`].
    pub fn align(
        &mut self,
        frame: &FrameSurface<'_>,
        recent: &[FrameSurface<'_>],
        keyframes: &dyn KeyframeSurfaces,
    ) -> FrameRecord {
        self.full_effort.set(&mut self.context, frame.effort);
        self.context.steps.enter(Step::Sampling);
        let mut samples = std::mem::take(&mut self.samples);
        self.sampler.draw(&frame.surface, frame.index, &self.context.registration, &mut samples);
        let surfaces = Surfaces { recent, keyframes };
        let record = self.align_samples(frame, &samples, &surfaces);
        self.samples = samples;
        self.context.steps.leave();
        record
    }

    fn align_samples(
        &mut self,
        frame: &FrameSurface<'_>,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
    ) -> FrameRecord {
        let prediction = self.predict(frame);
        if samples.len() < MIN_SAMPLES {
            let reason = format!("{} usable points, at least {MIN_SAMPLES} are needed", samples.len());
            // What the prediction went by, so that the next one goes by it too.
            let velocity = prediction.velocity.to_vector().into();
            return FrameRecord { velocity, ..self.lost(frame, &prediction, reason) };
        }
        if self.state.keyframes.is_empty() {
            return self.first(frame, &prediction);
        }
        let attempt = match self.find(frame, samples, surfaces, &prediction) {
            Ok(attempt) => attempt,
            Err(reason) => return self.lost(frame, &prediction, reason),
        };
        self.context.steps.enter(Step::Keyframe);
        let record = self.record(frame, &attempt, None);
        if attempt.state != State::Tracking {
            return record;
        }
        match self.promote(frame, &record, surfaces) {
            None => {
                let record = self.settled(frame, samples, surfaces, &attempt, record);
                self.with_request(frame, &attempt, record)
            }
            Some(keyframe) => {
                let (attempt, record) = self.realign(frame, samples, surfaces, &attempt, record, keyframe);
                let record = self.settled(frame, samples, surfaces, &attempt, record);
                self.with_request(frame, &attempt, record)
            }
        }
    }

    /// Tracks on from the frame before, or finds the frame's place again.
    fn find(
        &mut self,
        frame: &FrameSurface<'_>,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
    ) -> Result<Attempt, String> {
        // A run that starts in a map does not know where.
        let last = self.state.recent.last().map_or(State::Lost, |r| r.state);
        let reason = match last {
            State::Tracking => match self.attempt_all(samples, surfaces, prediction) {
                Ok(attempt) => return Ok(attempt),
                Err(reason) => reason,
            },
            State::Relocalising => match self.confirm(samples, surfaces, prediction) {
                Ok(attempt) => return Ok(attempt),
                Err(reason) => reason,
            },
            State::Lost if !self.state.is_placed => {
                format!("not found in the map for {} frames", self.state.n_lost)
            }
            State::Lost => format!("lost for {} frames", self.state.n_lost),
        };
        self.context.steps.enter(Step::Recognise);
        self.relocalise(frame, samples, surfaces, prediction, &reason)
    }

    /// Constant velocity in the time between the stamps; the last pose where that is no help. The
    /// rotation is the gyroscope's where the source has one.
    pub(crate) fn predict(&self, frame: &FrameSurface<'_>) -> Prediction {
        let w = &self.context.mapping.window;
        let still = |pose: Pose| Prediction {
            world_from_camera: pose,
            previous: None,
            is_known: false,
            velocity: Twist::default(),
            rotation_sigma_rad: None,
            first_distance_m: w.max_first_distance_m,
            outer_iterations: w.retry_iterations,
        };
        let Some(last) = self.state.recent.last() else {
            return still(self.state.start.as_ref().map_or(Pose::identity(), Pose::from));
        };
        let last_pose = Pose::from(&last.world_from_camera);
        let seconds = (frame.stamp_nanos - last.stamp_nanos) as f64 * 1e-9;
        let measured = self.measured_rotation(last, frame, seconds);
        let turn = measured.map(|m| Pose::from_parts(Vector3::zeros().into(), m.earlier_from_later));
        let last_turned = turn.map_or(last_pose, |turn| last_pose * turn);
        // A stamp that does not advance, or a gap in time, leaves no velocity to go by, nor does a
        // frame that fitted nowhere. A camera that saw nothing for a moment has moved on as before.
        let is_coasting = self.state.n_lost <= MOST_COASTED && last.velocity != [0.0; 6];
        if (last.state == State::Lost && !is_coasting) || !(seconds > 0.0 && seconds < 1.0) {
            return still(last_turned);
        }
        // The second frame of a run: the first has no motion yet.
        if last.velocity == [0.0; 6] {
            return Prediction { previous: Some((last_pose, seconds)), ..still(last_turned) };
        }
        let mut velocity = Twist::from_vector(&Vector6::from_column_slice(&last.velocity));
        if let Some(measured) = &measured {
            velocity.phi = measured.rate_rad_per_s(seconds);
        }
        let step = exp(&velocity.scaled(seconds));
        let (moved_m, turned_rad) = translation_rotation_norms(&step);
        let motion_m = moved_m + measured.map_or(turned_rad, |m| m.sigma_rad);
        Prediction {
            world_from_camera: compose_normalised(&last_pose, &velocity.scaled(seconds)),
            previous: Some((last_pose, seconds)),
            is_known: true,
            velocity,
            rotation_sigma_rad: measured.map(|m| m.sigma_rad),
            first_distance_m: (4.0 * motion_m).clamp(w.min_first_distance_m, w.max_first_distance_m),
            outer_iterations: w.outer_iterations,
        }
    }

    /// What a gyroscope says of the rotation since the last frame, where it says something.
    fn measured_rotation(
        &self,
        last: &RecentFrame,
        frame: &FrameSurface<'_>,
        seconds: f64,
    ) -> Option<RelativeRotation> {
        let (earlier, later) = (last.rotation?, frame.rotation?);
        let is_used = self.context.mapping.window.inertial_rotation && seconds > 0.0;
        let measured = earlier.until(&later, seconds);
        (is_used && measured.sigma_rad < MOST_INERTIAL_SIGMA_RAD).then_some(measured)
    }
}
