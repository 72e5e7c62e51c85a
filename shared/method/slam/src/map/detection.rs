//! Loop-closure detection by the poses, and the request for a global optimisation (III-G; method 7).

use crate::map::map_view::MapView;
use crate::map::records::RequestRecord;
use crate::map::state::{KeyframeState, TrackerState};
use crate::settings::LoopSettings;

/// Frames by which each keyframe delays the effect of a request: its share of the optimisation.
const DELAY_PER_KEYFRAME: f64 = 0.05;
/// Keyframes between two requests as a share of the working map: of a large one a few change little.
const INTERVAL_SHARE: f64 = 0.1;

/// A place along the trajectory, in time and in the graph.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrackPoint {
    /// The run, and its chain of odometry.
    session: u32,
    submap: u32,
    frame_index: u64,
    /// The keyframe, or the last one before it.
    keyframe: u32,
}

impl TrackPoint {
    pub(crate) fn of_keyframe(keyframe: &KeyframeState) -> Self {
        let KeyframeState { session, submap, frame_index, id, .. } = *keyframe;
        Self { session, submap, frame_index, keyframe: id }
    }

    /// A frame of this run that comes after all keyframes.
    pub(crate) fn of_frame(map: &MapView<'_>, index: u64) -> Self {
        let keyframe = (map.n_keyframes() as u32).saturating_sub(1);
        Self { session: map.state().session, submap: map.submap(), frame_index: index, keyframe }
    }
}

/// Whether a pair of these closes a loop: acquired long after each other in frames and in the graph,
/// by different runs or in different submaps.
pub(crate) fn closes_loop(settings: &LoopSettings, newer: &TrackPoint, older: &TrackPoint) -> bool {
    newer.session != older.session
        || newer.submap != older.submap
        || (newer.frame_index.saturating_sub(older.frame_index) > settings.min_frames
            && newer.keyframe.saturating_sub(older.keyframe) > LoopSettings::MIN_KEYFRAMES)
}

/// Whether seeing `keyframe` from frame `index` closes a loop.
pub(crate) fn is_loop<'a>(
    settings: &LoopSettings,
    map: impl Into<MapView<'a>>,
    keyframe: &KeyframeState,
    index: u64,
) -> bool {
    let frame = TrackPoint::of_frame(&map.into(), index);
    closes_loop(settings, &frame, &TrackPoint::of_keyframe(keyframe))
}

/// How long an optimisation may wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Urgency {
    /// Components were joined.
    AtOnce,
    /// Drift is seen that only an optimisation takes away.
    Soon,
    /// The window sees a loop, to which the frame is aligned already.
    Later,
}

impl Urgency {
    /// Keyframes that are made from one request to the next, at least, in a map of so many active ones.
    fn interval(self, settings: &LoopSettings, n_active: u32) -> u32 {
        let share = f64::from(n_active) * INTERVAL_SHARE;
        match self {
            Self::AtOnce => 0,
            Self::Soon => settings.request_interval,
            Self::Later => settings.request_interval.max(share as u32),
        }
    }
}

/// An optimisation request made at frame `index`; `None` while one is pending, or too shortly after the last.
/// The correction takes effect a number of frames later that depends on the graph's size alone.
pub(crate) fn request(
    settings: &LoopSettings,
    state: &TrackerState,
    index: u64,
    n_keyframes: u32,
    urgency: Urgency,
) -> Option<RequestRecord> {
    if state.pending.is_some() || n_keyframes < 2 {
        return None;
    }
    let n_retired = (state.keyframes.len() - state.active().count()) as u32;
    let n_active = n_keyframes.saturating_sub(n_retired);
    let next = state.n_keyframes_at_request.saturating_add(urgency.interval(settings, n_active));
    if state.n_keyframes_at_request > 0 && n_keyframes < next {
        return None;
    }
    let delay = f64::from(settings.delay_frames) + f64::from(n_active) * DELAY_PER_KEYFRAME;
    Some(RequestRecord {
        request: state.n_requests,
        n_keyframes,
        effective_before: index + 1 + delay as u64,
        is_final: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::keyframe;

    #[test]
    fn a_loop_is_far_in_frames_and_graph_or_of_another_run() {
        let settings = LoopSettings { min_frames: 20, ..LoopSettings::default() };
        let keyframes: Vec<KeyframeState> = (0..8).map(|id| keyframe(id, 1, 0.0)).collect();
        // Ten frames from keyframe to keyframe: more than five of them are needed.
        let [newest, older, near] = [7, 1, 2].map(|id| TrackPoint::of_keyframe(&keyframes[id]));
        assert!(closes_loop(&settings, &newest, &older) && !closes_loop(&settings, &newest, &near));
        let sparse = LoopSettings { min_frames: 60, ..settings.clone() };
        assert!(!closes_loop(&sparse, &newest, &older));
        assert!(closes_loop(&settings, &newest, &TrackPoint::of_keyframe(&keyframe(6, 0, 0.0))));
        // In the graph a frame counts as the last keyframe.
        let state = TrackerState { keyframes: keyframes.clone(), session: 1, ..TrackerState::default() };
        assert!(is_loop(&settings, &state, &keyframes[1], 75));
        assert!(!is_loop(&settings, &state, &keyframes[2], 75));
    }

    #[test]
    fn a_large_map_is_optimised_for_a_loop_less_often_and_for_drift_as_often() {
        let settings = LoopSettings::default();
        let state = |n: u32| TrackerState {
            keyframes: (0..n).map(|id| keyframe(id, 0, 0.0)).collect(),
            n_keyframes_at_request: n - 40,
            ..TrackerState::default()
        };
        let asked = |n: u32, urgency| request(&settings, &state(n), 900, n, urgency).is_some();
        assert!(asked(300, Urgency::Later) && !asked(500, Urgency::Later));
        assert!(asked(1000, Urgency::Soon) && asked(1000, Urgency::AtOnce));
        let request = request(&settings, &state(1000), 900, 1000, Urgency::Soon).unwrap();
        assert_eq!(request.effective_before, 901 + 15 + 50);
    }
}
