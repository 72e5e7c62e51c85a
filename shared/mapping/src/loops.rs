//! Which window poses were acquired long ago, and when to ask for an optimisation (SPEC 7).

use crate::records::RequestRecord;
use crate::settings::LoopSettings;
use crate::state::{KeyframeState, TrackerState};

/// Whether seeing `keyframe` from frame `index` closes a loop: long ago in index, time and graph,
/// or made by an earlier run.
pub(crate) fn is_loop(
    settings: &LoopSettings,
    state: &TrackerState,
    keyframe: &KeyframeState,
    index: u64,
    stamp_nanos: i64,
) -> bool {
    if !state.is_own(keyframe) {
        return true;
    }
    let seconds = (stamp_nanos - keyframe.stamp_nanos) as f64 * 1e-9;
    let hops = (state.keyframes.len() as u32).saturating_sub(keyframe.id + 1);
    index.saturating_sub(keyframe.frame_index) > settings.min_frames
        && seconds > settings.min_seconds
        && hops > settings.min_keyframes
}

/// Whether two keyframes are far enough apart in index, time and graph for a pair of them to
/// close a loop; those of different runs always are.
pub(crate) fn are_far(settings: &LoopSettings, newer: &KeyframeState, older: &KeyframeState) -> bool {
    if newer.session != older.session {
        return true;
    }
    let seconds = (newer.stamp_nanos - older.stamp_nanos) as f64 * 1e-9;
    newer.frame_index.saturating_sub(older.frame_index) > settings.min_frames
        && seconds > settings.min_seconds
        && newer.id.saturating_sub(older.id) > settings.min_keyframes
}

/// A request made at frame `index`, unless one is pending or, where it is not urgent, the last was
/// just now. The correction
/// takes effect a number of frames later that depends on the graph's size alone.
pub(crate) fn request(
    settings: &LoopSettings,
    state: &TrackerState,
    index: u64,
    n_keyframes: u32,
    is_urgent: bool,
) -> Option<RequestRecord> {
    let is_soon = !is_urgent
        && state.n_keyframes_at_request > 0
        && n_keyframes < state.n_keyframes_at_request + settings.request_interval;
    if state.pending.is_some() || is_soon || n_keyframes < 2 {
        return None;
    }
    let n_retired = state.keyframes.iter().filter(|k| !k.is_active()).count() as u32;
    let n_active = n_keyframes.saturating_sub(n_retired);
    let delay = f64::from(settings.delay_frames) + f64::from(n_active) * settings.delay_per_keyframe;
    Some(RequestRecord {
        request: state.n_requests,
        n_keyframes,
        effective_before: index + 1 + delay as u64,
        is_final: false,
    })
}
