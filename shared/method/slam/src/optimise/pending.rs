//! Requests that wait for an answer, with the map as it was at their records.

use crate::estimation::colour_model::ColourState;
use crate::estimation::noise_scales::NoiseState;
use crate::map::cameras::SessionCameras;
use crate::map::context::Context;
use crate::map::records::RequestRecord;
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::submaps::Submaps;

/// A request without an answer.
pub(crate) struct UnansweredRequest {
    pub(crate) request: RequestRecord,
    /// The state at its record, once the state itself has gone on. A copy of all keyframes: in a run they are
    /// answered before anything else is read.
    at_record: Option<Box<TrackerState>>,
}

impl UnansweredRequest {
    /// A request whose record was just taken into the state.
    pub(crate) fn new(request: RequestRecord) -> Self {
        Self { request, at_record: None }
    }

    /// To be called before the state goes on.
    pub(crate) fn keep(&mut self, state: &TrackerState) {
        self.at_record.get_or_insert_with(|| Box::new(state.clone()));
    }

    /// What it asks for, where `state` is that of the records so far.
    pub(crate) fn asks<'a>(&'a self, context: &'a Context, state: &'a TrackerState) -> Pending<'a> {
        let state = self.at_record.as_deref().unwrap_or(state);
        let n = (self.request.n_keyframes as usize).min(state.keyframes.len());
        Pending {
            request: self.request,
            keyframes: &state.keyframes[..n],
            submaps: &state.submaps,
            colour: state.colour,
            noise: state.noise,
            cameras: &context.cameras,
        }
    }
}

/// A request with the map as it was at its record.
#[derive(Clone, Copy)]
pub(crate) struct Pending<'a> {
    pub(crate) request: RequestRecord,
    pub(crate) keyframes: &'a [KeyframeState],
    pub(crate) submaps: &'a Submaps,
    pub(crate) colour: ColourState,
    pub(crate) noise: NoiseState,
    /// Of keyframes of several runs.
    pub(crate) cameras: &'a SessionCameras,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::{context, keyframe};

    #[test]
    fn a_request_is_of_the_map_at_its_record_and_copies_it_only_once_that_goes_on() {
        let context = context();
        let mut state = TrackerState { keyframes: vec![keyframe(0, 0, 0.0)], ..TrackerState::default() };
        let request = RequestRecord { request: 0, n_keyframes: 2, effective_before: 9, is_final: false };
        let mut waiting = UnansweredRequest::new(request);
        let own = state.keyframes.as_ptr();
        assert_eq!(waiting.asks(&context, &state).keyframes.as_ptr(), own);
        waiting.keep(&state);
        state.keyframes[0].world_from_camera.translation_m[0] = 7.0;
        state.keyframes.push(keyframe(1, 0, 1.0));
        waiting.keep(&state);
        let asked = waiting.asks(&context, &state);
        assert_eq!(asked.keyframes, [keyframe(0, 0, 0.0)]);
    }
}
