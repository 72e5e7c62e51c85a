//! One frame: align it from its prediction, judge the alignment, change the map, and publish.

use crate::estimation::colour_model::ColourState;
use crate::map::cause::Cause;
use crate::map::records::{FrameRecord, State};
use crate::submaps::departure::{is_compared, with_departure};
use crate::submaps::join::with_sighting;
use crate::submaps::submap;
use crate::tracking::alignment::Aligner;
use crate::tracking::audit::colour_record;
use crate::tracking::frame_record::{first_record, frame_record, lost_record};
use crate::tracking::input::{MIN_SAMPLES, TrackingInput};
use crate::tracking::prediction::Prediction;
use crate::tracking::promotion::{Promoted, with_keyframe, with_place};
use crate::tracking::trigger::with_request;
use crate::tracking::window_alignment::WindowAlignment;
use crate::tracking::{fixed_lag, hypotheses, relocalise, upright};
use tessera_numerics::Step;

/// The record of a frame. `posed` gets it as soon as the pose is known, where much is left to do for the map.
pub(crate) fn step(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
    posed: &mut dyn FnMut(&FrameRecord),
) -> FrameRecord {
    if input.samples.len() < MIN_SAMPLES {
        return sparse_record(input, prediction);
    }
    let state = input.map.state();
    if state.keyframes.is_empty() {
        let (prediction, levelling) = upright::levelled(input, prediction);
        return first_record(input, &prediction, vec![Cause::FirstFrame(levelling)]);
    }
    let aligned = match locate(input, aligner, prediction) {
        Err(causes) => return submap::lost_or_new(input, prediction, causes),
        Ok(aligned) => aligned,
    };
    input.context.steps.enter(Step::Keyframe);
    let input = &input.in_submap(aligned.submap);
    let record = frame_record(input, aligner, &aligned, None);
    if aligned.state != State::Tracking {
        return FrameRecord { lost_nanos: state.lost_nanos, ..record };
    }
    let Promoted { aligned, mut record, is_looked_for } = with_keyframe(input, aligner, aligned, record);
    let colour = colour_record(input, aligner, &aligned, prediction, record.change.new_keyframe.is_some());
    record.evidence.colour = colour;
    let record = fixed_lag::smoothed(&input.context.mapping.loops, state, &aligned, record);
    if has_more_to_do(input, &record) && !gives_colour_away(&state.colour, &record) {
        posed(&record);
        input.context.steps.enter(Step::Keyframe);
    }
    with_map(input, aligner, (&aligned, is_looked_for), record)
}

/// The record with what the frame changes in the map.
fn with_map(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    (aligned, is_looked_for): (&WindowAlignment, bool),
    record: FrameRecord,
) -> FrameRecord {
    if input.context.mapping.only_localise {
        return record;
    }
    let record = with_place(input, aligner, is_looked_for, record);
    let record = with_departure(input, aligner, record);
    let record = with_sighting(input, aligner, record);
    with_request(input, aligner, aligned, record)
}

/// The colour state behind a frame.
pub(crate) fn with_frame(before: &ColourState, record: &FrameRecord) -> ColourState {
    let mut after = *before;
    if let Some(colour) = &record.evidence.colour {
        after.apply_audit(colour);
    }
    after
}

/// Whether colour is trusted before a frame, and no longer behind it.
pub(crate) fn gives_colour_away(before: &ColourState, record: &FrameRecord) -> bool {
    before.is_trusted() && !with_frame(before, record).is_trusted()
}

/// Whether a tracked frame may change the map, which takes its time.
fn has_more_to_do(input: &TrackingInput<'_>, record: &FrameRecord) -> bool {
    record.change.new_keyframe.is_some() || is_compared(input) || input.map.state().submaps.n_components() > 1
}

/// The frame's place: tracked from the frame before, or found again in the map.
fn locate(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    prediction: &Prediction,
) -> Result<WindowAlignment, Vec<Cause>> {
    let state = input.map.state();
    // A run that starts in a map does not know where.
    let tracked = match state.recent.last().map_or(State::Lost, |r| r.state) {
        _ if relocalise::is_asked(input) => Err(Cause::RelocalisationAsked),
        State::Tracking => hypotheses::track(input, aligner, prediction),
        State::Relocalising => relocalise::confirm(input, aligner, prediction),
        State::Lost if !state.is_placed => Err(Cause::NotFoundFor(state.n_lost)),
        State::Lost => Err(Cause::LostFor(state.n_lost)),
    };
    tracked.or_else(|cause| {
        input.context.steps.enter(Step::Recognise);
        relocalise::relocalise(input, aligner, prediction, cause)
    })
}

/// The record of a frame with too few samples. It keeps the predicted velocity for the next frame.
fn sparse_record(input: &TrackingInput<'_>, prediction: &Prediction) -> FrameRecord {
    let (n_points, least) = (input.samples.len() as u32, MIN_SAMPLES as u32);
    let lost_nanos = input.map.state().lost_nanos;
    let mut record = lost_record(input, prediction, vec![Cause::TooFewPoints { n_points, least }]);
    record.pose.velocity = prediction.velocity.to_vector().into();
    FrameRecord { lost_nanos, ..record }
}
