//! Whether a map leans, by what accelerometers measured at its keyframes: without a loop nothing else asks for a
//! correction, which alone can turn all that a lean has bent. In a window of the newest keyframes the older ones hold
//! the lean.

use crate::evidence::gravity::Gravity;
use crate::map::context::Context;
use crate::map::records::FrameRecord;
use crate::map::state::{KeyframeState, TrackerState};
use crate::tracking::input::TrackingInput;
use tessera_geometry::Pose;
use tessera_graph::{Graph, INNER_ITERATIONS};

/// Whether a new keyframe shows that the map leans, with a direction that no optimisation had yet.
pub(crate) fn is_shown(input: &TrackingInput<'_>, record: &FrameRecord) -> bool {
    let state = input.map.state();
    let Some(made) = &record.change.new_keyframe else { return false };
    let became = state.recent.iter().find(|recent| recent.index == made.frame_index);
    let up = became.map_or(record.evidence.up, |recent| recent.up);
    let made = KeyframeState { up, ..KeyframeState::made(made, state.session, record.submap) };
    leans(input.context, state, &made)
}

/// Whether the working map of this run leans where it is, with its newest keyframe.
fn leans(context: &Context, state: &TrackerState, made: &KeyframeState) -> bool {
    let component = state.submaps.component(made.submap);
    let measured = |k: &&KeyframeState| {
        k.up.is_some() && state.is_own(k) && state.submaps.component(k.submap) == component
    };
    let keyframes: Vec<&KeyframeState> =
        state.active().chain(std::iter::once(made)).filter(measured).collect();
    let Gravity { instruments, priors, ups } = Gravity::of(context, &keyframes, &state.submaps);
    let newest = ups.measured.last().and_then(|up| keyframes.get(up.vertex));
    if newest.is_none_or(|k| k.id < state.n_keyframes_at_request) {
        return false;
    }
    let poses = keyframes.iter().map(|k| Pose::from(&k.world_from_camera));
    let poses: Vec<Pose> = poses.chain(instruments).collect();
    let is_fixed = (0..poses.len()).map(|vertex| vertex < keyframes.len()).collect();
    // The vertical and the constant error that fit best.
    let mut graph = Graph { poses, is_fixed, priors, ups, ..Graph::default() };
    let fitted = graph.optimise(INNER_ITERATIONS, &mut || ());
    fitted.is_ok() && graph.ups.show_lean(&graph.poses)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::test_wall::{context, keyframe};
    use nalgebra::Vector3;
    use tessera_geometry::UpDirection;

    /// Keyframes each four seconds, at which up leans by so much about x, radians.
    fn leaning(n: u32, lean: impl Fn(u32) -> f64) -> Vec<KeyframeState> {
        let made = |id: u32| {
            let up = UpDirection::of(&Vector3::new(0.0, -1.0, lean(id)), 0.02);
            KeyframeState { stamp_nanos: 4_000_000_000 * i64::from(id), up, ..keyframe(id, 0, 0.0) }
        };
        (0..n).map(made).collect()
    }

    #[test]
    fn a_lean_is_shown_until_a_request_has_it() {
        let shown = |mut keyframes: Vec<KeyframeState>, n_keyframes_at_request: u32| {
            let made = keyframes.pop().unwrap();
            let state = TrackerState { keyframes, n_keyframes_at_request, ..TrackerState::default() };
            leans(&context(), &state, &made)
        };
        let drift = |id: u32| 0.02 * f64::from(id);
        assert!(shown(leaning(16, drift), 0));
        assert!(!shown(leaning(16, drift), 16), "asked for already");
        assert!(!shown(leaning(16, |id| 0.01 * f64::from(id % 2)), 0), "less than what it errs by");
        let mut unmeasured = leaning(16, drift);
        unmeasured.iter_mut().for_each(|k| k.up = None);
        assert!(!shown(unmeasured, 0));
        assert!(!shown(leaning(1, drift), 0), "one direction is its own vertical");
    }
}
