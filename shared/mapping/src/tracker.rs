//! The aligner's pure step: a frame's surface in, its record out.

use crate::alignment::{Aligner, Alignment, Prediction, Reference};
use crate::context::Context;
use crate::keyframes::{self, Distance};
use crate::loops;
use crate::optimiser::input_hash;
use crate::records::{
    AlignRecord, AppliedCorrection, BlockRecord, Correction, EdgeRecord, FrameRecord, KeyframeRecord,
    RequestRecord, State, StoreSlot,
};
use crate::state::{KeyframeState, RecentFrame, TrackerState};
use crate::window::{self, Member};
use tessera_geometry::{
    Matrix6, Pose, PoseBits, Twist, Vector6, compose_normalised, exp, log, translation_rotation_norms,
};
use tessera_registration::{PairBlock, Sample, Sampler, entropy_of_covariance, metric_covariance};
use tessera_surface::{SurfaceView, Vertex};

/// A frame's surface with its identity.
#[derive(Clone, Copy, Debug)]
pub struct FrameSurface<'a> {
    /// Frame index as the source counts.
    pub index: u64,
    /// Sensor time.
    pub stamp_nanos: i64,
    /// The surface, read in place.
    pub surface: SurfaceView<'a>,
}

/// Read access to the surfaces of keyframes, in place.
pub trait KeyframeSurfaces: Sync {
    /// Vertices of a keyframe, row by row; the grid is the same for all.
    fn vertices(&self, keyframe: u32) -> &[Vertex];
}

/// Fewer samples than this cannot be aligned.
const MIN_SAMPLES: usize = 100;
/// No keyframe yet.
const NO_KEYFRAME: u32 = u32::MAX;

/// The aligner: a fold over [`AlignRecord`]s plus a pure step that makes the next one.
pub struct Tracker {
    context: Context,
    state: TrackerState,
    aligner: Aligner,
    sampler: Sampler,
    samples: Vec<Sample>,
}

/// Surfaces that one step may read.
struct Surfaces<'a> {
    recent: &'a [FrameSurface<'a>],
    keyframes: &'a dyn KeyframeSurfaces,
}

/// An alignment with the window it was made in.
struct Attempt {
    members: Vec<Member>,
    alignment: Alignment,
}

impl Tracker {
    /// A tracker that has seen nothing.
    pub fn new(context: Context) -> Self {
        let aligner = Aligner::new(&context);
        Self {
            context,
            state: TrackerState::default(),
            aligner,
            sampler: Sampler::default(),
            samples: Vec::new(),
        }
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

    /// The final request once the source is exhausted; `None` with fewer than two keyframes.
    pub fn final_request(&self) -> Option<RequestRecord> {
        let n_keyframes = self.state.keyframes.len() as u32;
        (n_keyframes >= 2).then_some(RequestRecord {
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
        let mut samples = std::mem::take(&mut self.samples);
        self.sampler.draw(&frame.surface, frame.index, &self.context.registration, &mut samples);
        let surfaces = Surfaces { recent, keyframes };
        let record = self.align_samples(frame, &samples, &surfaces);
        self.samples = samples;
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
            return self.lost(frame, &prediction, reason);
        }
        if self.state.keyframes.is_empty() {
            return self.first(frame, &prediction);
        }
        let attempt = match self.attempt_all(frame, samples, surfaces, &prediction) {
            Ok(attempt) => attempt,
            Err(reason) => return self.lost(frame, &prediction, reason),
        };
        let record = self.record(frame, &attempt, None);
        match self.promote(frame, &record, surfaces) {
            None => self.with_request(frame, &attempt, record),
            Some(keyframe) => {
                let (attempt, record) = self.realign(frame, samples, surfaces, &attempt, record, keyframe);
                self.with_request(frame, &attempt, record)
            }
        }
    }

    /// Constant velocity in the time between the stamps; the last pose where that is no help.
    fn predict(&self, frame: &FrameSurface<'_>) -> Prediction {
        let w = &self.context.mapping.window;
        let still = |pose: Pose| Prediction {
            world_from_camera: pose,
            previous: None,
            velocity: Twist::default(),
            first_distance_m: w.max_first_distance_m,
            outer_iterations: w.retry_iterations,
        };
        let Some(last) = self.state.recent.last() else { return still(Pose::identity()) };
        let last_pose = Pose::from(&last.world_from_camera);
        let seconds = (frame.stamp_nanos - last.stamp_nanos) as f64 * 1e-9;
        // A stamp that does not advance, or a gap in time, leaves no velocity to go by.
        if last.state != State::Tracking || !(seconds > 0.0 && seconds < 1.0) {
            return still(last_pose);
        }
        let velocity = Twist::from_vector(&Vector6::from_column_slice(&last.velocity));
        let step = exp(&velocity.scaled(seconds));
        let (moved_m, turned_rad) = translation_rotation_norms(&step);
        let motion_m = moved_m + turned_rad;
        Prediction {
            world_from_camera: compose_normalised(&last_pose, &velocity.scaled(seconds)),
            previous: Some((last_pose, seconds)),
            velocity,
            first_distance_m: (4.0 * motion_m).clamp(w.min_first_distance_m, w.max_first_distance_m),
            outer_iterations: w.outer_iterations,
        }
    }

    /// The prediction first; after a failure the last pose with wide limits; then the last
    /// keyframe alone (SPEC 6). The error says in numbers why none will do.
    fn attempt_all(
        &mut self,
        frame: &FrameSurface<'_>,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
    ) -> Result<Attempt, String> {
        let first = self.attempt(frame, samples, surfaces, prediction);
        let Err(reason) = self.judge(&first) else { return Ok(first) };
        let w = &self.context.mapping.window;
        let mut wide = Prediction {
            first_distance_m: w.max_first_distance_m,
            outer_iterations: w.retry_iterations,
            ..*prediction
        };
        if let Some(last) = self.state.recent.last() {
            wide.world_from_camera = Pose::from(&last.world_from_camera);
            wide.velocity = Twist::default();
        }
        let second = self.attempt(frame, samples, surfaces, &wide);
        if self.judge(&second).is_ok() {
            return Ok(second);
        }
        if let Some(keyframe) = self.state.keyframes.last() {
            wide.world_from_camera = Pose::from(&keyframe.world_from_camera);
            wide.previous = None;
            let third = self.attempt(frame, samples, surfaces, &wide);
            if self.judge(&third).is_ok() {
                return Ok(third);
            }
        }
        Err(reason)
    }

    fn attempt(
        &mut self,
        _frame: &FrameSurface<'_>,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
    ) -> Attempt {
        let window = &self.context.mapping.window;
        let mut members = window::select(&self.state, window, &prediction.world_from_camera, 0);
        let references: Vec<Reference<'_>> = {
            let (mut kept, mut references) = (Vec::new(), Vec::new());
            for member in members {
                if let Some(reference) = self.reference(member, surfaces) {
                    kept.push(member);
                    references.push(reference);
                }
            }
            members = kept;
            references
        };
        let alignment = self.aligner.align(&self.context, samples, &references, prediction);
        Attempt { members, alignment }
    }

    fn reference<'a>(&self, member: Member, surfaces: &Surfaces<'a>) -> Option<Reference<'a>> {
        let (pose, velocity, surface) = match member {
            Member::Recent(place) => {
                let recent = &self.state.recent[place];
                let surface = surfaces.recent.iter().find(|s| s.index == recent.index)?.surface;
                (&recent.world_from_camera, &recent.velocity, surface)
            }
            Member::Keyframe(id) => {
                let keyframe = self.state.keyframes.get(id as usize)?;
                // A keyframe promoted at this step is not in the store yet; its bits are the same.
                let fresh =
                    surfaces.recent.iter().find(|s| s.index == keyframe.frame_index).map(|s| s.surface);
                let surface = fresh.unwrap_or_else(|| SurfaceView {
                    grid: self.context.grid,
                    vertices: surfaces.keyframes.vertices(id),
                });
                (&keyframe.world_from_camera, &keyframe.velocity, surface)
            }
        };
        let velocity = Twist::from_vector(&Vector6::from_column_slice(velocity));
        Some(Reference {
            world_from_camera: Pose::from(pose),
            surface,
            shutter: self.context.shutter(&velocity),
        })
    }

    /// The failure tests of SPEC 6.
    fn judge(&self, attempt: &Attempt) -> Result<(), String> {
        let w = &self.context.mapping.window;
        let a = &attempt.alignment;
        if !a.is_solved {
            return Err("the normal equations could not be solved".into());
        }
        if !(a.match_share() >= w.min_match_share) {
            let (found, least) = (100.0 * a.match_share(), 100.0 * w.min_match_share);
            return Err(format!(
                "{found:.1} % of the queries have a match, at least {least:.1} % are needed"
            ));
        }
        if !(a.residual_sigmas() <= w.max_residual_sigmas) {
            let (found, most) = (a.residual_sigmas(), w.max_residual_sigmas);
            return Err(format!(
                "median residual is {found:.2} standard deviations, at most {most:.2} are allowed"
            ));
        }
        Ok(())
    }

    fn record(
        &self,
        frame: &FrameSurface<'_>,
        attempt: &Attempt,
        new_keyframe: Option<KeyframeRecord>,
    ) -> FrameRecord {
        let a = &attempt.alignment;
        let last_keyframe = self.state.keyframes.last();
        let keyframe_pose = last_keyframe.map_or(Pose::identity(), |k| Pose::from(&k.world_from_camera));
        let factor = self.aligner.metric_factor();
        let blocks: Vec<BlockRecord> = attempt
            .members
            .iter()
            .zip(&a.blocks)
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
                entropy_of_covariance(&PairBlock::new(origin, sums).linearise(&now).0, factor)
            })
            .unwrap_or(f64::NAN);
        FrameRecord {
            index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            state: State::Tracking,
            reason: String::new(),
            world_from_camera: PoseBits::from(&a.world_from_camera),
            world_from_odom: self.state.world_from_odom.unwrap_or(PoseBits::IDENTITY),
            keyframe: last_keyframe.map_or(NO_KEYFRAME, |k| k.id),
            keyframe_from_camera: PoseBits::from(&(keyframe_pose.inverse() * a.world_from_camera)),
            covariance: metric_covariance(&a.information, factor).map_or(Vec::new(), |c| upper_triangle(&c)),
            n_correspondences: a.n_matches(),
            velocity: a.velocity.to_vector().into(),
            entropy_nats,
            blocks,
            new_keyframe,
            request: None,
        }
    }

    /// The first frame with enough points: the map's origin and its first keyframe.
    fn first(&self, frame: &FrameSurface<'_>, prediction: &Prediction) -> FrameRecord {
        let bits = PoseBits::from(&prediction.world_from_camera);
        let keyframe = KeyframeRecord {
            id: 0,
            frame_index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            world_from_camera: bits,
            velocity: [0.0; 6],
            slot: StoreSlot::default(),
            edges: Vec::new(),
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
    fn lost(&self, frame: &FrameSurface<'_>, prediction: &Prediction, reason: String) -> FrameRecord {
        let keyframe = self.state.keyframes.last();
        let keyframe_pose = keyframe.map_or(Pose::identity(), |k| Pose::from(&k.world_from_camera));
        FrameRecord {
            index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            state: State::Lost,
            reason,
            world_from_camera: PoseBits::from(&prediction.world_from_camera),
            world_from_odom: self.state.world_from_odom.unwrap_or(PoseBits::IDENTITY),
            keyframe: keyframe.map_or(NO_KEYFRAME, |k| k.id),
            keyframe_from_camera: PoseBits::from(&(keyframe_pose.inverse() * prediction.world_from_camera)),
            covariance: Vec::new(),
            n_correspondences: 0,
            velocity: [0.0; 6],
            entropy_nats: f64::NAN,
            blocks: Vec::new(),
            new_keyframe: None,
            request: None,
        }
    }

    /// The previous frame as a keyframe, when the new one is too far from the last (SPEC 9.1).
    fn promote(
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
        let is_at_hand = surfaces.recent.iter().any(|s| s.index == previous.index);
        if previous.index == last_keyframe.frame_index
            || previous.state != State::Tracking
            || !is_at_hand
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
    fn realign(
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
            frame_index: keyframe.frame_index,
            stamp_nanos: keyframe.stamp_nanos,
            world_from_camera: keyframe.world_from_camera,
            velocity: keyframe.velocity,
            slot: keyframe.slot,
            edges: Vec::new(),
        });
        let mut prediction = self.predict(frame);
        prediction.world_from_camera = first.alignment.world_from_camera;
        prediction.velocity = first.alignment.velocity;
        prediction.first_distance_m = self.context.mapping.window.min_first_distance_m;
        let second = self.attempt(frame, samples, surfaces, &prediction);
        let result = if self.judge(&second).is_ok() {
            let mut keyframe = keyframe;
            keyframe.edges = self.edges(frame, &second);
            let record = self.record(frame, &second, Some(keyframe));
            (second, record)
        } else {
            // The first alignment stands, hung on the keyframe it was made with.
            (
                Attempt { members: first.members.clone(), alignment: first.alignment.clone() },
                FrameRecord { new_keyframe: Some(keyframe), ..record },
            )
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
    fn with_request(
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
        if sees_loop {
            let n_keyframes = self.state.keyframes.len() as u32 + u32::from(record.new_keyframe.is_some());
            record.request = loops::request(settings, &self.state, frame.index, n_keyframes);
        }
        record
    }
}

/// 21 numbers, row by row.
fn upper_triangle(m: &Matrix6) -> Vec<f64> {
    (0..6).flat_map(|r| (r..6).map(move |c| (r, c))).map(|(r, c)| m[(r, c)]).collect()
}
