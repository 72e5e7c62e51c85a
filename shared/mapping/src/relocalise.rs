//! Lost and found: where could this frame be?
//!
//! The last pose is tried first, then the keyframes that look most like the frame, then views
//! turned and shifted against both, a few in each frame. A candidate counts only after it has
//! been aligned and has passed the strict tests, and only after several frames in a row have
//! passed them the map may change again.

use crate::alignment::Prediction;
use crate::attempt::Attempt;
use crate::judge;
use crate::records::State;
use crate::settings::WindowSettings;
use crate::tracker::{FrameSurface, Surfaces, Tracker};
use crate::window::{self, Member};
use tessera_geometry::{Pose, Twist, exp};
use tessera_recognition::similarity;
use tessera_registration::Sample;

/// Samples of the first, coarse alignment of a candidate.
const COARSE_SAMPLES: usize = 500;
/// References of a coarse alignment.
const COARSE_REFERENCES: usize = 2;

/// A pose from which an alignment is worth a try.
struct Candidate {
    start: Pose,
    /// The view whose neighbours are the references.
    near: Pose,
    name: String,
    is_last_pose: bool,
}

impl Tracker {
    /// Tracks on after the frame's place was found, under the strict tests, until enough frames
    /// in a row have passed.
    pub(crate) fn confirm(
        &mut self,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
    ) -> Result<Attempt, String> {
        let settings = self.context.mapping.relocalise.clone();
        let wide = Prediction {
            first_distance_m: self.context.mapping.window.max_first_distance_m,
            outer_iterations: self.context.mapping.window.retry_iterations,
            ..*prediction
        };
        let members = self.near(&prediction.world_from_camera, usize::MAX);
        let attempt = self.attempt_in(members, samples, surfaces, &wide);
        let numbers = judge::found_again(&settings, &attempt.alignment)?;
        let n_confirmed = self.state.n_confirmed + 1;
        let state =
            if n_confirmed >= settings.confirm_frames { State::Tracking } else { State::Relocalising };
        let reason = format!("confirmed {n_confirmed} of {} times: {numbers}", settings.confirm_frames);
        Ok(Attempt { state, reason, ..attempt })
    }

    /// Looks for the frame's place in the map.
    pub(crate) fn relocalise(
        &mut self,
        frame: &FrameSurface<'_>,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
        why_lost: &str,
    ) -> Result<Attempt, String> {
        let settings = self.context.mapping.relocalise.clone();
        if !settings.enabled {
            return Err(why_lost.into());
        }
        let coarse = coarse(samples);
        let candidates = self.candidates(frame, prediction);
        let n_candidates = candidates.len();
        for candidate in candidates {
            let start = self.wide(&candidate.start);
            let Some((attempt, numbers)) = self.settle(&start, &candidate.near, [&coarse, samples], surfaces)
            else {
                continue;
            };
            // Along a free direction the place is a guess, unless the camera never left it.
            if !attempt.alignment.free.is_empty() && !candidate.is_last_pose {
                continue;
            }
            let reason = format!("{why_lost}; found by {}: {numbers}", candidate.name);
            return Ok(Attempt { state: State::Relocalising, reason, ..attempt });
        }
        Err(format!("{why_lost}; none of {n_candidates} candidate places fits"))
    }

    /// Aligns from a start, first some samples to what lies near a view, then all of them to what
    /// lies near the place itself. With the numbers of the strict tests where it passes them.
    pub(crate) fn settle(
        &mut self,
        start: &Prediction,
        near: &Pose,
        [coarse, samples]: [&[Sample]; 2],
        surfaces: &Surfaces<'_>,
    ) -> Option<(Attempt, String)> {
        let settings = self.context.mapping.relocalise.clone();
        let members = self.near(near, COARSE_REFERENCES);
        if members.is_empty() {
            return None;
        }
        let attempt = self.attempt_in(members, coarse, surfaces, start);
        judge::found_again(&settings.coarse(), &attempt.alignment).ok()?;
        let found = attempt.alignment.world_from_camera;
        let members = self.near(&found, usize::MAX);
        let attempt =
            self.attempt_in(members, samples, surfaces, &Prediction { world_from_camera: found, ..*start });
        let numbers = judge::found_again(&settings, &attempt.alignment).ok()?;
        Some((attempt, numbers))
    }

    /// A place to begin from that no motion leads to.
    pub(crate) fn wide(&self, start: &Pose) -> Prediction {
        Prediction {
            world_from_camera: *start,
            previous: None,
            is_known: false,
            velocity: Twist::default(),
            rotation_sigma_rad: None,
            first_distance_m: self.context.mapping.window.max_first_distance_m,
            outer_iterations: self.context.mapping.window.retry_iterations,
        }
    }

    /// Keyframes that may see something of what `view` sees, nearest first.
    fn near(&self, view: &Pose, at_most: usize) -> Vec<Member> {
        let w = WindowSettings { radius_m: 1.5, angle_deg: 50.0, ..self.context.mapping.window.clone() };
        let near = window::near(&self.state, &w, view);
        near.into_iter().take(at_most.min(w.size as usize)).map(|(_, id)| Member::Keyframe(id)).collect()
    }

    fn candidates(&self, frame: &FrameSurface<'_>, prediction: &Prediction) -> Vec<Candidate> {
        let settings = &self.context.mapping.relocalise;
        let last = prediction.world_from_camera;
        let direct =
            |pose: Pose, name: String| Candidate { start: pose, near: pose, name, is_last_pose: false };
        // Where nobody said where the run starts, the prediction is but a guess.
        let is_last_pose = self.state.is_placed || self.state.start.is_some();
        let name = if self.state.is_placed { "the last pose" } else { "the start" };
        let mut candidates = vec![Candidate { is_last_pose, ..direct(last, name.into()) }];
        let code = self.ferns.code(&frame.surface);
        let active = self.state.keyframes.iter().filter(|k| k.is_active());
        let mut alike: Vec<(f64, u32)> = active.map(|k| (similarity(&code, &k.place), k.id)).collect();
        alike.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let poses: Vec<Pose> = alike
            .iter()
            .take(settings.n_recognised as usize)
            .map(|(_, id)| Pose::from(&self.state.keyframes[*id as usize].world_from_camera))
            .collect();
        candidates.extend(poses.iter().zip(&alike).map(|(pose, (similarity, id))| {
            direct(*pose, format!("recognising keyframe {id} (similarity {similarity:.2})"))
        }));
        let turned = turned_views();
        let n = settings.n_turned as usize;
        // Around the last pose and around the best look-alike in turn, another part each time.
        let round = self.state.n_lost as usize;
        let base = if round.is_multiple_of(2) { last } else { poses.first().copied().unwrap_or(last) };
        candidates.extend((0..n).map(|k| {
            let delta = &turned[(round / 2 * n + k) % turned.len()];
            Candidate { start: base * delta, ..direct(base, "a turned view".into()) }
        }));
        candidates
    }
}

/// Some of the samples: they may be in any order, so an even choice covers the whole frame.
pub(crate) fn coarse(samples: &[Sample]) -> Vec<Sample> {
    let step = samples.len().div_ceil(COARSE_SAMPLES).max(1);
    samples.iter().step_by(step).copied().collect()
}

/// Turns about the vertical axis of the camera with shifts along the others.
fn turned_views() -> Vec<Pose> {
    let mut views = Vec::new();
    for shift in [[0.0, 0.0], [0.5, 0.0], [-0.5, 0.0], [0.0, 0.5], [0.0, -0.5]] {
        for yaw_deg in [0.0_f64, 20.0, -20.0, 40.0, -40.0] {
            let mut twist = Twist::default();
            twist.phi.y = yaw_deg.to_radians();
            views.push(Pose::translation(shift[0], 0.0, shift[1]) * exp(&twist));
        }
    }
    views.remove(0);
    views
}
