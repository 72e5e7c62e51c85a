//! The begin of a submap: a camera that has been lost for long goes on in a map of its own.

use crate::map::cause::Cause;
use crate::map::records::FrameRecord;
use crate::map::state::MOST_COASTED_S;
use crate::tracking::frame_record::{first_record, lost_record};
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Prediction;
use crate::tracking::upright;

/// The record of a frame whose place was not found: lost, or the first frame of a submap.
pub(crate) fn lost_or_new(
    input: &TrackingInput<'_>,
    prediction: &Prediction,
    mut causes: Vec<Cause>,
) -> FrameRecord {
    let lost_nanos = lost_nanos(input);
    let after_s = input.context.mapping.submaps.after_s;
    // A run that starts in a map is looked for there alone.
    let may_begin = input.map.state().is_placed && !input.context.mapping.only_localise;
    let is_due = may_begin && after_s > 0.0 && lost_nanos as f64 * 1e-9 >= after_s;
    if !is_due {
        return FrameRecord { lost_nanos, ..lost_record(input, prediction, causes) };
    }
    let submap = input.map.state().submaps.n();
    let (prediction, levelling) = upright::levelled(input, prediction);
    causes.push(Cause::SubmapBegins(submap, levelling));
    first_record(&input.in_submap(submap), &prediction, causes)
}

/// Time lost with this frame, nanoseconds; it stands still while there is little to see, and a gap in a recording says
/// nothing of the places that were looked for.
fn lost_nanos(input: &TrackingInput<'_>) -> i64 {
    let state = input.map.state();
    let registration = &input.context.registration;
    let n_sought = registration.uniform_samples + registration.normal_space_samples;
    if 2 * input.samples.len() < n_sought as usize {
        return state.lost_nanos;
    }
    let last_nanos = state.recent.last().map_or(input.frame.stamp_nanos, |last| last.stamp_nanos);
    let step = input.frame.stamp_nanos.saturating_sub(last_nanos).clamp(0, (1e9 * MOST_COASTED_S) as i64);
    state.lost_nanos.saturating_add(step)
}
