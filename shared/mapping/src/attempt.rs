//! One frame against its window, and what is tried after a failure (SPEC 6).

use crate::alignment::{Alignment, Prediction, Reference};
use crate::judge;
use crate::records::State;
use crate::tracker::{Surfaces, Tracker};
use crate::window::{self, Member};
use tessera_geometry::{Pose, Twist, Vector6};
use tessera_registration::Sample;
use tessera_surface::SurfaceView;

/// An alignment with the window it was made in.
#[derive(Clone, Debug)]
pub(crate) struct Attempt {
    pub(crate) members: Vec<Member>,
    pub(crate) alignment: Alignment,
    /// What the frame becomes if the attempt stands.
    pub(crate) state: State,
    /// Why, where it is not plain tracking.
    pub(crate) reason: String,
}

impl Tracker {
    /// The prediction first; after a failure the last pose with wide limits; then the last
    /// keyframe (SPEC 6), then a long stride, all under the strict tests; so is the first where the
    /// motion is not known. The error says why the first will not do.
    pub(crate) fn attempt_all(
        &mut self,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
    ) -> Result<Attempt, String> {
        let w = &self.context.mapping.window.clone();
        let strict = &self.context.mapping.relocalise.clone();
        let start =
            if prediction.is_known { *prediction } else { self.turned(samples, surfaces, prediction) };
        let first = self.attempt(samples, surfaces, &start);
        let passes = judge::tracking(w, &first.alignment);
        let is_sure = judge::found_again(strict, &first.alignment).is_ok();
        if passes.is_ok() && prediction.is_known {
            return Ok(if is_sure { first } else { self.doubted(samples, surfaces, prediction, first) });
        }
        if is_sure {
            return Ok(first);
        }
        let mut wide = Prediction {
            first_distance_m: w.max_first_distance_m,
            outer_iterations: w.retry_iterations,
            ..*prediction
        };
        if let Some(last) = self.state.recent.last() {
            wide.world_from_camera = Pose::from(&last.world_from_camera);
            wide.velocity = Twist::default();
            if prediction.rotation_sigma_rad.is_some() {
                wide.world_from_camera.rotation = prediction.world_from_camera.rotation;
            }
        }
        let wide_turned = self.turned(samples, surfaces, &wide);
        let second = self.attempt(samples, surfaces, &wide_turned);
        // Along a free direction a start that is no prediction decides nothing.
        let stands = |attempt: &Attempt| {
            attempt.alignment.free.is_empty() && judge::found_again(strict, &attempt.alignment).is_ok()
        };
        if stands(&second) {
            return Ok(second);
        }
        if let Some(keyframe) = self.state.last_own_keyframe() {
            wide.world_from_camera = Pose::from(&keyframe.world_from_camera);
            (wide.previous, wide.is_known, wide.rotation_sigma_rad) = (None, false, None);
            let third = self.attempt(samples, surfaces, &wide);
            if stands(&third) {
                return Ok(third);
            }
        }
        if let Some((found, numbers)) = self.long_stride(samples, surfaces, prediction) {
            let why = passes.err().unwrap_or_else(|| "the motion is not known".into());
            return Ok(Attempt { reason: format!("{why}; found by a long stride: {numbers}"), ..found });
        }
        // A guess that passes stands only where nothing fits better.
        passes.map(|()| first)
    }

    /// An attempt that passes, but not the strict tests: a camera that turned faster than expected
    /// may have come to rest in the wrong place. Another one, from a turn that fits better, is
    /// taken if it ends with more points on its references.
    fn doubted(
        &mut self,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
        first: Attempt,
    ) -> Attempt {
        let strict = &self.context.mapping.relocalise.clone();
        let w = &self.context.mapping.window;
        let wide = Prediction {
            first_distance_m: w.max_first_distance_m,
            outer_iterations: w.retry_iterations,
            is_known: false,
            ..*prediction
        };
        let turned = self.turned(samples, surfaces, &wide);
        let second = self.attempt(samples, surfaces, &turned);
        let is_better = judge::found_again(strict, &second.alignment).is_ok()
            && second.alignment.fitting() > first.alignment.fitting();
        if is_better { second } else { first }
    }

    pub(crate) fn attempt(
        &mut self,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
    ) -> Attempt {
        let window = &self.context.mapping.window;
        let members = window::select(&self.state, window, &prediction.world_from_camera, 0);
        self.attempt_in(members, samples, surfaces, prediction)
    }

    /// Aligns to these members, without those whose surface is not at hand.
    pub(crate) fn attempt_in(
        &mut self,
        members: Vec<Member>,
        samples: &[Sample],
        surfaces: &Surfaces<'_>,
        prediction: &Prediction,
    ) -> Attempt {
        let (members, references): (Vec<Member>, Vec<Reference<'_>>) = members
            .into_iter()
            .filter_map(|member| Some((member, self.reference(member, surfaces)?)))
            .unzip();
        let alignment = self.aligner.align(&self.context, samples, &references, prediction);
        Attempt { members, alignment, state: State::Tracking, reason: String::new() }
    }

    pub(crate) fn reference<'a>(&self, member: Member, surfaces: &Surfaces<'a>) -> Option<Reference<'a>> {
        let (pose, velocity, key, surface) = match member {
            Member::Recent(place) => {
                let recent = &self.state.recent[place];
                let surface = surfaces.recent.iter().find(|s| s.index == recent.index)?.surface;
                (&recent.world_from_camera, &recent.velocity, (false, recent.index), surface)
            }
            Member::Keyframe(id) => {
                let keyframe = self.state.keyframes.get(id as usize)?;
                // A keyframe promoted at this step is not in the store yet; its bits are the same.
                let is_own = self.state.is_own(keyframe);
                let fresh = surfaces
                    .recent
                    .iter()
                    .find(|s| is_own && s.index == keyframe.frame_index)
                    .map(|s| s.surface);
                let surface = fresh.unwrap_or_else(|| SurfaceView {
                    grid: self.context.grid,
                    vertices: surfaces.keyframes.vertices(id),
                });
                (&keyframe.world_from_camera, &keyframe.velocity, (true, u64::from(id)), surface)
            }
        };
        let velocity = Twist::from_vector(&Vector6::from_column_slice(velocity));
        Some(Reference {
            world_from_camera: Pose::from(pose),
            key,
            surface,
            shutter: self.context.shutter(&velocity),
        })
    }
}
