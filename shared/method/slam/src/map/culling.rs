//! A map of bounded size: keyframes beyond the budget leave the working map.
//!
//! The keyframe with the nearest neighbour is culled, so that the map is thinned where it is densest
//! and every place keeps a view. A culled keyframe is anchored to that neighbour by the pose between
//! them; its surface stays in the store for the outputs, and nothing is aligned to it any more. The
//! choice is journaled, so that a replay does the same.

use crate::map::records::RetiredRecord;
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::submaps::Submaps;
use crate::settings::MappingSettings;
use nalgebra::Vector3;
use tessera_geometry::Pose;

/// The newest keyframes, which are never culled: the window and the next loop test need them.
const NEWEST: usize = 5;
/// Keyframes culled at a time: one for the new keyframe, and one more where a run starts in a map
/// beyond its budget.
const MOST_AT_A_TIME: usize = 2;

/// Pose of a keyframe of the working map.
struct View {
    id: u32,
    component: u32,
    centre: Vector3<f64>,
    axis: Vector3<f64>,
}

impl View {
    fn of(submaps: &Submaps, keyframe: &KeyframeState) -> Self {
        let pose = Pose::from(&keyframe.world_from_camera);
        let (centre, axis) = (pose.translation.vector, pose.rotation * Vector3::z());
        Self { id: keyframe.id, component: submaps.component(keyframe.submap), centre, axis }
    }
}

/// Keyframes to cull when one more is made; none without a budget.
pub(crate) fn culled(state: &TrackerState, settings: &MappingSettings) -> Vec<RetiredRecord> {
    let budget = settings.keyframe.budget as usize;
    let n_active = state.keyframes.iter().filter(|k| k.is_active()).count() + 1;
    if budget == 0 || n_active <= budget {
        return Vec::new();
    }
    let active = state.keyframes.iter().filter(|k| k.is_active());
    let mut views: Vec<View> = active.map(|k| View::of(&state.submaps, k)).collect();
    let mut culled = Vec::new();
    for _ in 0..(n_active - budget).min(MOST_AT_A_TIME) {
        let Some((place, anchored_to)) = least_needed(&views, settings) else { break };
        let keyframe = views.remove(place).id;
        culled.push(RetiredRecord { keyframe, anchored_to });
    }
    culled
}

/// Place of the view that has another one nearest to it, and that other one's keyframe; the newest
/// among equals. The first keyframe of each component is the origin of its gauge and stays.
fn least_needed(views: &[View], settings: &MappingSettings) -> Option<(usize, u32)> {
    let window = &settings.window;
    let per_square_metre = 1.0 / (window.radius_m * window.radius_m).max(1e-12);
    let per_turn = 1.0 / (1.0 - libm::cos(window.angle_deg.to_radians())).max(1e-12);
    let apart = |a: &View, b: &View| {
        (a.centre - b.centre).norm_squared() * per_square_metre + (1.0 - a.axis.dot(&b.axis)) * per_turn
    };
    let end = views.len().saturating_sub(NEWEST);
    let mut best: Option<(f64, usize, u32)> = None;
    for place in (1..end).rev() {
        let component = views[place].component;
        if views[..place].iter().all(|view| view.component != component) {
            continue;
        }
        for (other, view) in views.iter().enumerate().filter(|(_, view)| view.component == component) {
            let distance = apart(&views[place], view);
            if other != place && best.is_none_or(|(least, ..)| distance < least) {
                best = Some((distance, place, view.id));
            }
        }
    }
    best.map(|(_, place, anchored_to)| (place, anchored_to))
}

/// Poses of all keyframes from those of the active ones: the others move along with
/// their anchors.
pub(crate) fn with_retired(
    keyframes: &[KeyframeState],
    active: &[KeyframeState],
    solved: &[Pose],
) -> Vec<Pose> {
    let solved_of = |id: u32| active.binary_search_by_key(&id, |k| k.id).ok().and_then(|k| solved.get(k));
    keyframes
        .iter()
        .map(|keyframe| {
            let old = Pose::from(&keyframe.world_from_camera);
            if let Some(pose) = solved_of(keyframe.id) {
                return *pose;
            }
            let anchor = keyframe.anchored_to.and_then(|id| keyframes.get(id as usize));
            match anchor.and_then(|anchor| Some((anchor, solved_of(anchor.id)?))) {
                Some((anchor, pose)) => pose * Pose::from(&anchor.world_from_camera).inverse() * old,
                None => old,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::PoseBits;

    fn keyframe(id: u32, x_m: f64) -> KeyframeState {
        KeyframeState {
            id,
            session: 0,
            submap: 0,
            frame_index: u64::from(id),
            stamp_nanos: 0,
            world_from_camera: PoseBits::from(&Pose::translation(x_m, 0.0, 0.0)),
            velocity: [0.0; 6],
            slot: crate::StoreSlot::default(),
            edges: Vec::new(),
            covariance: Vec::new(),
            place: vec![1],
            anchored_to: None,
        }
    }

    fn line(x_m: &[f64]) -> TrackerState {
        let keyframes = x_m.iter().enumerate().map(|(id, x)| keyframe(id as u32, *x)).collect();
        TrackerState { keyframes, ..TrackerState::default() }
    }

    fn settings(budget: u32) -> MappingSettings {
        let mut settings = MappingSettings::default();
        settings.keyframe.budget = budget;
        settings
    }

    #[test]
    fn the_densest_place_is_thinned_and_the_ends_stay() {
        // Close pairs stand at the origin, in the middle and among the newest; only the middle may go.
        let x = [0.0, 0.001, 0.2, 0.4, 0.41, 0.6, 0.8, 1.0, 1.2, 1.2, 1.2, 1.2, 1.2];
        let mut state = line(&x[1..]);
        assert_eq!(culled(&state, &settings(0)), []);
        assert_eq!(culled(&state, &settings(13)), []);
        let expected = RetiredRecord { keyframe: 3, anchored_to: 2 };
        assert_eq!(culled(&state, &settings(12)), [expected]);
        assert_eq!(culled(&state, &settings(5)).len(), MOST_AT_A_TIME);
        state = line(&x);
        assert_eq!(culled(&state, &settings(13)), [RetiredRecord { keyframe: 1, anchored_to: 0 }]);
    }

    #[test]
    fn submaps_that_are_apart_are_thinned_each_by_itself() {
        let x = [0.0, 0.2, 0.201, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4];
        let mut state = line(&x);
        let expected = RetiredRecord { keyframe: 2, anchored_to: 1 };
        assert_eq!(culled(&state, &settings(9)), [expected]);
        // Keyframe 2 is the origin of another gauge now, in which keyframe 3 is its neighbour.
        state.keyframes[2..].iter_mut().for_each(|k| k.submap = 1);
        assert_eq!(culled(&state, &settings(9)), [RetiredRecord { keyframe: 3, anchored_to: 2 }]);
    }

    #[test]
    fn what_anchored_to_a_keyframe_goes_where_it_goes() {
        let mut state = line(&[0.0, 0.1, 0.2, 0.3]);
        state.retire(&RetiredRecord { keyframe: 1, anchored_to: 2 });
        state.retire(&RetiredRecord { keyframe: 2, anchored_to: 3 });
        assert_eq!(state.keyframes[1].anchored_to, Some(3), "its own anchor went");
        let active: Vec<KeyframeState> = state.keyframes.iter().filter(|k| k.is_active()).cloned().collect();
        assert_eq!(active.iter().map(|k| k.id).collect::<Vec<_>>(), [0, 3]);
        let solved = [Pose::identity(), Pose::translation(0.3, 1.0, 0.0)];
        let all = with_retired(&state.keyframes, &active, &solved);
        let expected = [[0.0, 0.0], [0.1, 1.0], [0.2, 1.0], [0.3, 1.0]];
        for (pose, [x, y]) in all.iter().zip(expected) {
            let t = pose.translation.vector;
            assert!((t.x - x).abs() < 1e-12 && (t.y - y).abs() < 1e-12, "{t}");
        }
    }
}
