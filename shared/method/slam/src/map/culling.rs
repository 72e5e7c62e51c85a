//! A map as dense as it needs to be (method 12.2): keyframes near others, and those beyond a budget,
//! leave the working map.
//!
//! Of those that have another keyframe near, the one with the least room around it is culled, so that
//! the map is thinned where it is densest and every place keeps a view. A culled keyframe is anchored
//! to its neighbour by the pose between them; its surface stays in the store for the outputs, and
//! nothing is aligned to it any more. The choice is journaled, so that a replay does the same.

use crate::map::records::RetiredRecord;
use crate::map::state::{KeyframeState, TrackerState};
use crate::map::submaps::Submaps;
use crate::settings::{LoopSettings, MappingSettings};
use nalgebra::Vector3;
use std::collections::BTreeMap;
use tessera_geometry::Pose;

/// Keyframes of a map that is small enough to be kept whole: each one's surface has noise of its own,
/// which the others average out.
const KEPT_WHOLE: usize = 40;
/// Keyframes of a map from which on it is thinned the more the larger it is: by the root of their number,
/// so that a way of any length has few enough to be solved for, and a room all that it needs.
const LARGE: usize = 200;
/// Keyframes culled at a time: one for the new keyframe, and one more where a run starts in a map
/// that is too dense or beyond its budget.
pub(crate) const MOST_AT_A_TIME: usize = 2;
/// Time for which tracking looks back at what keyframes saw, culled or not, nanoseconds: beyond it drift is no
/// longer small.
pub(crate) const LOOKED_BACK_NANOS: i64 = 5_000_000_000;
/// Distance that a turn of one radian counts as: a degree is a centimetre.
const METRES_PER_RADIAN: f64 = 0.573;

/// Pose of a keyframe of the working map.
#[derive(Clone, Copy)]
struct CullingView {
    id: u32,
    component: u32,
    centre: Vector3<f64>,
    axis: Vector3<f64>,
}

impl CullingView {
    fn of(submaps: &Submaps, keyframe: &KeyframeState) -> Self {
        let pose = Pose::from(&keyframe.world_from_camera);
        let (centre, axis) = (pose.translation.vector, pose.rotation * Vector3::z());
        Self { id: keyframe.id, component: submaps.component(keyframe.submap), centre, axis }
    }

    /// Distance of the centres and the angle between the optical axes together, metres; `None` where the centres
    /// alone are as far apart as `most_m`.
    fn distance_m(&self, other: &Self, most_m: f64) -> Option<f64> {
        let apart_sq = (self.centre - other.centre).norm_squared();
        let turn = || METRES_PER_RADIAN * (self.axis - other.axis).norm();
        (apart_sq < most_m * most_m).then(|| (apart_sq + turn() * turn()).sqrt())
    }
}

/// A view that could be culled.
struct CullingCandidate {
    id: u32,
    nearest: u32,
    nearest_m: f64,
    /// Distances to the two nearest others, metres: a view between two others is needed less than one
    /// beyond them.
    room_m: f64,
}

/// Keyframes to cull when one more is made.
pub(crate) fn culled(state: &TrackerState, settings: &MappingSettings) -> Vec<RetiredRecord> {
    let mut views: Vec<CullingView> = state.active().map(|k| CullingView::of(&state.submaps, k)).collect();
    let budget = if settings.keyframe.budget == 0 { usize::MAX } else { settings.keyframe.budget as usize };
    let mut culled = Vec::new();
    // With the one that is made now.
    while views.len() >= budget.min(KEPT_WHOLE) && culled.len() < MOST_AT_A_TIME {
        let Some(candidate) = least_needed(&views) else { break };
        let is_redundant =
            candidate.nearest_m < redundant_within_m(settings, views.len()) && views.len() >= KEPT_WHOLE;
        if !is_redundant && views.len() < budget {
            break;
        }
        views.retain(|view| view.id != candidate.id);
        culled.push(RetiredRecord { keyframe: candidate.id, anchored_to: candidate.nearest });
    }
    culled
}

/// Distance to another keyframe below which one of a map of `n` is redundant, metres.
fn redundant_within_m(settings: &MappingSettings, n: usize) -> f64 {
    settings.keyframe.redundant_within_m * (n as f64 / LARGE as f64).max(1.0).sqrt()
}

/// The view with the least room among those that are not the newest; the newest among equals. The
/// first keyframe of each component is the origin of its gauge and stays.
fn least_needed(views: &[CullingView]) -> Option<CullingCandidate> {
    // The newest ones are needed by the window, and close no loop yet.
    let settled = &views[..views.len().saturating_sub(LoopSettings::MIN_KEYFRAMES as usize)];
    let mut by_x: Vec<&CullingView> = settled.iter().collect();
    by_x.sort_by(|a, b| a.centre.x.total_cmp(&b.centre.x).then(a.id.cmp(&b.id)));
    let mut components: BTreeMap<u32, (u32, usize)> = BTreeMap::new();
    settled.iter().for_each(|view| components.entry(view.component).or_insert((view.id, 0)).1 += 1);
    // The first view of a view's component, and how many there are.
    let of = |view: &CullingView| components.get(&view.component).copied().unwrap_or((view.id, 1));
    let mut least: Option<CullingCandidate> = None;
    for (at, view) in by_x.iter().enumerate() {
        let (first, n) = of(view);
        if first == view.id {
            continue;
        }
        // Views farther away than the least room so far cannot make a room as small.
        let within_m = least.as_ref().map_or(f64::INFINITY, |least| least.room_m * (1.0 + 1e-9));
        let Some(found) = candidate(&by_x, at, within_m, n == 2) else { continue };
        let is_less = |least: &CullingCandidate| {
            found.room_m.total_cmp(&least.room_m).then(least.id.cmp(&found.id)).is_lt()
        };
        if least.as_ref().is_none_or(is_less) {
            least = Some(found);
        }
    }
    least
}

/// A view with its two nearest others of the same component; `None` where it has none within `within_m`, or one
/// alone, unless it is one of two. `by_x`: sorted by the x of their centres, so that most need not be looked at.
fn candidate(
    by_x: &[&CullingView],
    at: usize,
    within_m: f64,
    is_one_of_two: bool,
) -> Option<CullingCandidate> {
    let view = by_x[at];
    let (mut nearest, mut first_m, mut second_m) = (None, f64::INFINITY, f64::INFINITY);
    let mut look = |other: &CullingView| {
        let most_m = second_m.min(within_m);
        if (other.centre.x - view.centre.x).abs() > most_m {
            return false;
        }
        if other.component == view.component
            && let Some(distance_m) = view.distance_m(other, most_m)
        {
            if distance_m < first_m {
                (nearest, first_m, second_m) = (Some(other.id), distance_m, first_m);
            } else {
                second_m = second_m.min(distance_m);
            }
        }
        true
    };
    let _ = by_x[..at].iter().rev().all(|other| look(other));
    let _ = by_x[at + 1..].iter().all(|other| look(other));
    // One of two views has no second neighbour.
    let other_m = if is_one_of_two { first_m } else { second_m };
    let is_found = other_m.is_finite();
    let nearest = nearest.filter(|_| is_found)?;
    Some(CullingCandidate { id: view.id, nearest, nearest_m: first_m, room_m: first_m + other_m })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::PoseBits;
    use tessera_numerics::SplitMix64;

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
            up: None,
            place: vec![1],
            alike: Vec::new(),
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
    fn the_least_room_so_far_hides_no_smaller_one() {
        let mut random = SplitMix64::for_frame(7, 3);
        for n in [0usize, 1, 2, 6, 7, 8, 9, 40, 300] {
            let mut views: Vec<CullingView> = (0..n as u32)
                .map(|id| CullingView {
                    id,
                    component: u32::from(random.below(9) == 0),
                    // Steps of a centimetre: equal rooms do occur.
                    centre: Vector3::from_fn(|_, _| f64::from(random.below(60) as u32) * 0.01),
                    axis: Vector3::z(),
                })
                .collect();
            // Two views of a component of their own, far apart.
            for view in views.iter_mut().filter(|view| view.id == 3 || view.id == 5) {
                (view.component, view.centre) = (7, Vector3::x() * f64::from(view.id));
            }
            let settled = &views[..n.saturating_sub(LoopSettings::MIN_KEYFRAMES as usize)];
            let all: Vec<&CullingView> = settled.iter().collect();
            let is_first = |view: &CullingView| {
                settled.iter().find(|other| other.component == view.component).map(|first| first.id)
                    == Some(view.id)
            };
            let expected = (0..all.len())
                .filter(|at| !is_first(all[*at]))
                .filter_map(|at| {
                    let others = settled.iter().filter(|other| other.id != all[at].id);
                    let same = others.filter(|other| other.component == all[at].component);
                    let mut metres: Vec<f64> =
                        same.filter_map(|other| all[at].distance_m(other, f64::INFINITY)).collect();
                    metres.sort_by(f64::total_cmp);
                    let first = *metres.first()?;
                    Some((first + *metres.get(1).unwrap_or(&first), all[at].id))
                })
                .min_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
            let found = least_needed(&views).map(|found| (found.room_m, found.id));
            assert_eq!(found, expected, "{n} views");
        }
    }

    #[test]
    fn beyond_a_budget_the_densest_place_is_thinned_and_the_ends_stay() {
        // Close pairs stand at the origin, in the middle and among the newest; only the middle may go.
        let x = [0.0, 0.001, 0.1, 0.4, 0.41, 0.6, 0.8, 1.0, 1.2, 1.2, 1.2, 1.2, 1.2];
        let mut state = line(&x[1..]);
        assert_eq!(culled(&state, &settings(0)), []);
        assert_eq!(culled(&state, &settings(13)), []);
        let expected = RetiredRecord { keyframe: 3, anchored_to: 2 };
        assert_eq!(culled(&state, &settings(12)), [expected]);
        assert_eq!(culled(&state, &settings(10)).len(), MOST_AT_A_TIME);
        state = line(&x);
        assert_eq!(culled(&state, &settings(13)), [RetiredRecord { keyframe: 1, anchored_to: 0 }]);
    }

    #[test]
    fn a_large_map_loses_what_others_see_as_well() {
        // Half a metre apart, but for one between two of them and a pair among the newest.
        let mut x: Vec<f64> = (0..KEPT_WHOLE as u32).map(|k| 0.5 * f64::from(k)).collect();
        x.insert(20, 9.56);
        x.push(19.51);
        let expected = RetiredRecord { keyframe: 20, anchored_to: 19 };
        assert_eq!(culled(&line(&x), &settings(0)), [expected]);
        assert_eq!(culled(&line(&x[5..]), &settings(0)), [], "small enough to be kept whole");
        let mut kept = settings(0);
        kept.keyframe.redundant_within_m = 0.05;
        assert_eq!(culled(&line(&x), &kept), [], "far enough");
        // Another direction is another view.
        let mut turned = line(&x);
        let turn = tessera_geometry::exp(&tessera_geometry::Twist {
            rho: Vector3::zeros(),
            phi: Vector3::new(0.0, 0.1, 0.0),
        });
        turned.keyframes[20].world_from_camera = PoseBits::from(&(Pose::translation(9.56, 0.0, 0.0) * turn));
        assert_eq!(culled(&turned, &settings(0)), []);
    }

    #[test]
    fn a_map_four_times_as_large_is_half_as_dense() {
        let row = |n: usize, apart_m: f64| -> Vec<f64> { (0..n).map(|k| apart_m * k as f64).collect() };
        assert_eq!(culled(&line(&row(LARGE, 0.1)), &settings(0)), []);
        assert_eq!(culled(&line(&row(4 * LARGE, 0.1)), &settings(0)).len(), MOST_AT_A_TIME);
        assert_eq!(culled(&line(&row(4 * LARGE, 0.151)), &settings(0)), []);
    }

    #[test]
    fn a_view_between_two_others_goes_before_one_at_the_end_of_a_row() {
        let state = line(&[0.0, 5.0, 5.05, 5.11, 9.0, 9.0, 9.0, 9.0, 9.0]);
        assert_eq!(culled(&state, &settings(9)), [RetiredRecord { keyframe: 2, anchored_to: 1 }]);
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
    }
}
