//! The aligner's pure step: a frame's surface in, its record out.

use crate::estimation::colour_model::ColourState;
use crate::map::appearance::Ferns;
use crate::map::context::Context;
use crate::map::input_hash::input_hash;
use crate::map::map_view::MapView;
use crate::map::records::{AlignRecord, AppliedCorrection, Correction, FrameRecord, RequestRecord, State};
use crate::map::state::TrackerState;
use crate::map::surfaces::KeyframeSurfaces;
use crate::step::{gives_colour_away, step, with_frame};
use crate::tracking::alignment::Aligner;
use crate::tracking::input::{FrameSurface, Surfaces, TrackingInput};
use crate::tracking::motion_model::predict;
use crate::tracking::window::Member;
use crate::tracking::workload::Workload;
use crate::tracking::{passing, relocalise};
use tessera_numerics::Step;
use tessera_registration::{Sample, Sampler};

/// The aligner: a fold over [`AlignRecord`]s plus a pure step that makes the next one.
pub struct Tracker {
    pub(crate) state: TrackerState,
    workload: Workload,
    aligner: Aligner,
    ferns: Ferns,
    sampler: Sampler,
    samples: Vec<Sample>,
}

impl Tracker {
    /// A tracker that has seen nothing.
    pub fn new(context: Context) -> Self {
        Self {
            state: TrackerState::of_camera(&context.camera),
            workload: Workload::new(&context),
            aligner: Aligner::new(&context),
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
        self.align_pose_first(frame, recent, keyframes, &mut |_| ())
    }

    /// As [`Self::align`], with the pose as soon as it is known where much is left to do for the map behind it:
    /// `posed` gets the record as it is then, at most once. State, poses, covariance, matches and velocity in it
    /// are those of the answer; its reason and all that concerns the map are not yet.
    pub fn align_pose_first(
        &mut self,
        frame: &FrameSurface<'_>,
        recent: &[FrameSurface<'_>],
        keyframes: &dyn KeyframeSurfaces,
        posed: &mut dyn FnMut(&FrameRecord),
    ) -> FrameRecord {
        let before = self.state.colour;
        let record = self.align_by(&before, frame, recent, keyframes, posed);
        if !gives_colour_away(&before, &record) {
            return record;
        }
        // Colour that this frame gives away has no part in it.
        let after = with_frame(&before, &record);
        let mut alone = self.align_by(&after, frame, recent, keyframes, &mut |_| ());
        if alone.state != State::Tracking {
            return record;
        }
        alone.evidence.colour = record.evidence.colour;
        alone
    }

    /// Aligns a frame with what is known of colour.
    fn align_by(
        &mut self,
        colour: &ColourState,
        frame: &FrameSurface<'_>,
        recent: &[FrameSurface<'_>],
        keyframes: &dyn KeyframeSurfaces,
        posed: &mut dyn FnMut(&FrameRecord),
    ) -> FrameRecord {
        let context = self.workload.at(frame.workload).with_colour(colour, &self.state.noise);
        let context = &context.with_motion(&self.state.motion);
        context.steps.enter(Step::Sampling);
        self.sampler.draw(&frame.surface, frame.index, &context.registration, &mut self.samples);
        let input = TrackingInput {
            context,
            map: MapView::from(&self.state),
            ferns: &self.ferns,
            frame,
            samples: &self.samples,
            surfaces: Surfaces { recent, keyframes },
            view_before: self.state.recent.len().checked_sub(1).map(Member::Recent),
        };
        let is_asked = relocalise::is_asked(&input);
        let prediction = predict(&input);
        let before = self.state.recent.last().and_then(|last| recent.iter().find(|r| r.index == last.index));
        context.steps.enter(Step::Match);
        self.aligner.sight.begin(context, frame, before, &prediction.velocity);
        context.steps.enter(Step::Dynamic);
        let at_rest = passing::at_rest(&input, &mut self.aligner.sight, &prediction);
        let input = TrackingInput { samples: at_rest.as_deref().unwrap_or(input.samples), ..input };
        context.steps.enter(Step::Match);
        let mut record = step(&input, &mut self.aligner, &prediction, posed);
        context.steps.leave();
        record.evidence.repeats_colour = self.aligner.sight.is_repeated;
        if is_asked { relocalise::noted(record) } else { record }
    }
}
