//! Removal of dynamic points (method 6): samples that lie in space a recent keyframe saw through are excluded.
//!
//! A person who walks close by is half of the view, and the nearest and so the most precise half: the frame would
//! follow. But a keyframe of a second ago saw through where the person is now.

use crate::map::context::Context;
use crate::map::culling::LOOKED_BACK_NANOS;
use crate::map::keyframe::KeyframeState;
use crate::map::map_view::MapView;
use crate::settings::MappingSettings;
use crate::tracking::input::{MIN_SAMPLES, TrackingInput};
use crate::tracking::keyframe_test;
use crate::tracking::prediction::{Prediction, Reference};
use crate::tracking::sight::Sight;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::reference;
use nalgebra::Vector3;
use tessera_geometry::Pose;
use tessera_registration::{FreeSpaceView, GridCamera, Sample, mark_free_space};
use tessera_surface::{SurfaceView, Vertex};

/// Keyframes that are asked, no older than [`LOOKED_BACK_NANOS`], and the time between them and before the frame,
/// nanoseconds: in less, little has moved.
const MOST_ASKED: usize = 3;
const APART_NANOS: i64 = 400_000_000;
/// How far behind a point a keyframe must have seen, metres, and standard deviations of both depths.
const BEHIND_M: f32 = 0.1;
const BEHIND_SIGMAS: f32 = 3.0;
/// Share of the samples that must have moved: less is noise.
const LEAST_SHARE: f64 = 0.05;

/// Samples of a frame that are at rest, and features as well; `None` where it has all of them left.
pub(crate) fn at_rest(
    input: &TrackingInput<'_>,
    sight: &mut Sight,
    prediction: &Prediction,
) -> Option<Vec<Sample>> {
    let seen_through = SeenThrough::from(input, prediction);
    let at_rest = seen_through.at_rest(input.samples)?;
    sight.leave_out(|point| seen_through.has_moved(point));
    Some(at_rest)
}

/// Surface of a recent keyframe, and its pose relative to the frame.
struct PastView<'a> {
    surface: SurfaceView<'a>,
    view_from_camera: Pose,
}

/// Free space of recent keyframes, from the predicted pose of a frame.
struct SeenThrough<'a> {
    context: &'a Context,
    views: Vec<PastView<'a>>,
}

impl<'a> SeenThrough<'a> {
    /// From a predicted pose; nothing is known where the prediction is not precise.
    fn from(input: &TrackingInput<'a>, prediction: &Prediction) -> Self {
        let context = input.context;
        let is_robust = !context.registration.variant.is_paper();
        let is_wanted =
            context.mapping.window.at_rest_only && is_robust && is_precise(&context.mapping, prediction);
        let ids = if is_wanted { asked(&input.map, input.frame.stamp_nanos) } else { Vec::new() };
        let view = |id| {
            let Reference { surface, world_from_camera, .. } = reference(input, Member::Keyframe(id))?;
            let view_from_camera = world_from_camera.inverse() * prediction.world_from_camera;
            Some(PastView { surface, view_from_camera })
        };
        Self { context: input.context, views: ids.into_iter().filter_map(view).collect() }
    }

    /// The samples at rest; `None` where all of them are, or where too many are not.
    fn at_rest(&self, samples: &[Sample]) -> Option<Vec<Sample>> {
        if self.views.is_empty() {
            return None;
        }
        let views = self.views_through(samples);
        let has_moved = |sample: &Sample, views: u32| {
            views != 0 && self.is_before(&sample.point, |view| views >> view & 1 == 1)
        };
        // Mostly all of them are at rest: the samples are copied only where some are not.
        let have_moved: Vec<bool> =
            samples.iter().zip(&views).map(|(s, views)| has_moved(s, *views)).collect();
        let n_at_rest = have_moved.iter().filter(|has_moved| !**has_moved).count();
        let at_rest = samples.iter().zip(&have_moved).filter(|(_, has_moved)| !**has_moved);
        let share = 1.0 - n_at_rest as f64 / samples.len() as f64;
        (n_at_rest >= MIN_SAMPLES && share >= LEAST_SHARE)
            .then(|| at_rest.map(|(sample, _)| *sample).collect())
    }

    /// For each sample the views that may have seen through where it is, a bit each: few, and never one too few.
    fn views_through(&self, samples: &[Sample]) -> Vec<u32> {
        let Context { camera, grid, registration, .. } = self.context;
        let camera = GridCamera::new(camera, *grid, 0.0);
        let mut views = vec![0; samples.len()];
        for (bit, PastView { surface, view_from_camera }) in (0..).zip(&self.views) {
            let view = FreeSpaceView { surface: *surface, view_from_camera: *view_from_camera };
            mark_free_space(&camera, registration.isa, &view, samples, BEHIND_M, bit, &mut views);
        }
        views
    }

    /// Whether a point of the frame, metres in its camera, is in space that a keyframe saw through.
    fn has_moved(&self, point: &[f32; 3]) -> bool {
        self.is_before(point, |_| true)
    }

    /// As [`Self::has_moved`], of some of the views.
    fn is_before(&self, point: &[f32; 3], is_asked: impl Fn(usize) -> bool) -> bool {
        let point = Vector3::from(point.map(f64::from));
        self.views.iter().enumerate().any(|(place, view)| {
            let at = &view.view_from_camera;
            is_asked(place) && view.is_before(self.context, &(at.rotation * point + at.translation.vector))
        })
    }
}

impl PastView<'_> {
    /// Whether all nine vertices about the pixel of a point were seen and lie behind it: an edge may be a cell away.
    fn is_before(&self, context: &Context, point: &Vector3<f64>) -> bool {
        let Some((row, column)) = context.camera.project(point) else { return false };
        let (grid, depth_m) = (self.surface.grid, point.z as f32);
        let cell = |pixel: f64| libm::floor(pixel / grid.step as f64) as i64;
        let (row, column) = (cell(row), cell(column));
        let is_inside =
            row >= 1 && column >= 1 && row < grid.height as i64 - 1 && column < grid.width as i64 - 1;
        if !is_inside {
            return false;
        }
        let is_behind = |vertex: &Vertex| {
            let seen_m = vertex.position[2];
            let noise_m = context.noise.sigma_m(depth_m) + context.noise.sigma_m(seen_m);
            vertex.is_valid() && seen_m >= depth_m + BEHIND_M + BEHIND_SIGMAS * noise_m
        };
        (row - 1..=row + 1).all(|row| {
            let first = row as usize * grid.width + column as usize - 1;
            self.surface.vertices[first..first + 3].iter().all(is_behind)
        })
    }
}

/// Whether a prediction is as good as what is asked of it: it errs by a part of the motion since the last frame, which is
/// less than from keyframe to keyframe.
fn is_precise(settings: &MappingSettings, prediction: &Prediction) -> bool {
    let Some((previous, _)) = prediction.previous.filter(|_| prediction.is_known) else { return false };
    !keyframe_test::is_far(&settings.keyframe, &(previous.inverse() * prediction.world_from_camera))
}

/// Keyframes of this run that are old enough and not too old at a time in nanoseconds, the newest first. Culled
/// ones as well: where the map is known, each new one is.
fn asked(map: &MapView<'_>, now: i64) -> Vec<u32> {
    let age = |k: &KeyframeState| now.saturating_sub(k.stamp_nanos);
    let own = map.state().keyframes.iter().rev().take_while(|k| map.is_own(k));
    let mut asked: Vec<&KeyframeState> = Vec::new();
    for keyframe in own.take_while(|k| age(k) <= LOOKED_BACK_NANOS) {
        let is_apart = age(keyframe) - asked.last().map_or(0, |last| age(last)) >= APART_NANOS;
        if is_apart && map.contains(keyframe) && asked.len() < MOST_ASKED {
            asked.push(keyframe);
        }
    }
    asked.into_iter().map(|k| k.id).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::map::state::TrackerState;
    use crate::map::surfaces::KeyframeSurfaces;
    use crate::map::test_wall::{Walls, context, keyframe};

    fn sample(x_m: f32, depth_m: f32) -> Sample {
        Sample { point: [x_m, 0.0, depth_m], normal: [0.0, 0.0, -1.0], grid_row: 0 }
    }

    #[test]
    fn what_stands_before_a_wall_that_was_seen_has_moved() {
        let context = context();
        let walls = Walls::seen_by(&context, &[keyframe(0, 0, 0.0)]);
        let surface = SurfaceView { grid: context.grid, vertices: walls.vertices(0) };
        // The frame is 0.1 m to the right of the keyframe, which saw the wall at 2 m.
        let view_from_camera = Pose::translation(0.1, 0.0, 0.0);
        let seen = SeenThrough { context: &context, views: vec![PastView { surface, view_from_camera }] };
        assert!(seen.has_moved(&[0.0, 0.0, 1.5]) && !seen.has_moved(&[0.0, 0.0, 2.0]));
        assert!(!seen.has_moved(&[0.0, 0.0, 1.87]), "that may be noise");
        assert!(!seen.has_moved(&[0.0, 0.0, 2.5]), "behind the wall nothing was seen");
        assert!(!seen.has_moved(&[1.0, 0.0, 1.5]), "beside its view nothing was seen");
        let samples =
            |n_before: usize| [vec![sample(0.0, 1.5); n_before], vec![sample(0.0, 2.0); 400]].concat();
        let n_at_rest = |n_before| seen.at_rest(&samples(n_before)).map(|at_rest| at_rest.len());
        assert_eq!(n_at_rest(400), Some(400));
        assert_eq!((n_at_rest(16), n_at_rest(1600)), (None, Some(400)), "that is noise");
        assert_eq!(SeenThrough { context: &context, views: Vec::new() }.at_rest(&samples(400)), None);
    }

    #[test]
    fn keyframes_asked_are_asked_some_time_apart() {
        let made = |id: u32, stamp_nanos: i64| KeyframeState { stamp_nanos, ..keyframe(id, 1, 0.0) };
        let tenths = [0, 50, 60, 62, 70, 80, 90, 97];
        let keyframes = (0..).zip(tenths.map(|t| t * 100_000_000)).map(|(id, stamp)| made(id, stamp));
        let mut state =
            TrackerState { session: 1, keyframes: keyframes.collect(), ..TrackerState::default() };
        let ids = |state: &TrackerState| asked(&MapView::from(state), 10_000_000_000);
        assert_eq!(ids(&state), [6, 5, 4]);
        state.keyframes[5].anchored_to = Some(4);
        assert_eq!(ids(&state), [6, 5, 4], "a culled one saw what it saw");
        state.keyframes[5].session = 0;
        assert_eq!(ids(&state), [6], "one of an earlier run has another clock");
    }

    #[test]
    fn a_prediction_is_precise_while_the_camera_moves_little() {
        let settings = MappingSettings::default();
        let moved = |x_m: f64, is_known: bool| Prediction {
            world_from_camera: Pose::translation(x_m, 0.0, 0.0),
            previous: Some((Pose::identity(), 0.03)),
            is_known,
            velocity: tessera_geometry::Twist::default(),
            rotation_sigma_rad: None,
            motion: None,
            first_distance_m: 0.1,
            outer_iterations: 6,
        };
        assert!(is_precise(&settings, &moved(0.09, true)) && !is_precise(&settings, &moved(0.11, true)));
        assert!(!is_precise(&settings, &moved(0.05, false)), "no motion is known");
        assert!(!is_precise(&settings, &Prediction { previous: None, ..moved(0.05, true) }));
    }
}
