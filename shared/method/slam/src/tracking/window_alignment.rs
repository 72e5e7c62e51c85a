//! A frame aligned to a window of the map, from an initial guess (method 5.1, 6).

use crate::map::cause::{Cause, ReferenceFit};
use crate::map::map_view::MapView;
#[cfg(doc)]
use crate::map::records::FrameRecord;
use crate::map::records::State;
use crate::map::state::KeyframeState;
use crate::pairs::covisibility;
use crate::tracking::acceptance;
use crate::tracking::alignment::{Aligner, Alignment};
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::{Prediction, Reference};
use crate::tracking::window::{self, Member};
use std::borrow::Cow;
use tessera_geometry::{Pose, Twist, Vector6};
use tessera_registration::Sample;
use tessera_surface::SurfaceView;

/// Samples by which poses are compared, and of a coarse alignment.
pub(crate) const COARSE_SAMPLES: usize = 500;

/// An alignment with the window it was made in.
#[derive(Clone, Debug)]
pub(crate) struct WindowAlignment {
    pub(crate) members: Vec<Member>,
    pub(crate) alignment: Alignment,
    /// State of the frame if the alignment is accepted.
    pub(crate) state: State,
    /// The submap whose gauge the pose is in.
    pub(crate) submap: u32,
    /// Why, where it is not plain tracking.
    pub(crate) causes: Vec<Cause>,
    /// Evidence so far where the place is not yet certain, as in [`FrameRecord::evidence_nats`].
    pub(crate) evidence_nats: f64,
}

impl WindowAlignment {
    /// The keyframes of the window: of one about a place, the nearest first.
    pub(crate) fn keyframes<'a>(&self, map: MapView<'a>) -> impl Iterator<Item = &'a KeyframeState> {
        self.members.iter().filter_map(move |member| match member {
            Member::Keyframe(id) => map.keyframe(*id),
            Member::Recent(_) => None,
        })
    }
}

/// Aligns all samples to the local window about the initial guess.
pub(crate) fn align_to_window(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    guess: &Prediction,
) -> WindowAlignment {
    let members = window::select(&input.map, &input.context.mapping.window, &guess.world_from_camera);
    align_to(input, aligner, members, input.samples, guess)
}

/// Aligns samples to these members, without those whose surface is not at hand.
pub(crate) fn align_to(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    members: Vec<Member>,
    samples: &[Sample],
    guess: &Prediction,
) -> WindowAlignment {
    let (members, mut references): (Vec<Member>, Vec<Reference<'_>>) =
        members.into_iter().filter_map(|member| Some((member, reference(input, member)?))).unzip();
    let weight = input.context.feature_weight() * aligner.independent_factor();
    aligner.sight.pair_all(input.context, &mut references, &guess.world_from_camera, weight);
    let mut alignment = aligner.align(input.context, samples, &references, guess);
    if input.context.is_colour_trusted {
        alignment.n_agreeing = aligner.sight.n_agreeing(&references, &alignment.world_from_camera);
    }
    let (state, submap, causes) = (State::Tracking, input.map.submap(), Vec::new());
    WindowAlignment { members, alignment, state, submap, causes, evidence_nats: 0.0 }
}

/// Aligns some samples to the keyframe nearest to the initial guess, then all samples to the keyframes near the
/// result. `None` unless both pass the strict tests; with the fit of the second.
pub(crate) fn align_coarse_to_fine(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    guess: &Prediction,
) -> Option<(WindowAlignment, ReferenceFit)> {
    let members = nearby_keyframes(input, &guess.world_from_camera, 1);
    if members.is_empty() {
        return None;
    }
    // Samples may be in any order: an even choice covers the whole frame.
    let coarse = every_nth(input.samples, COARSE_SAMPLES);
    let first = align_to(input, aligner, members, &coarse, guess);
    acceptance::strict(&first.alignment).ok()?;
    let found = first.alignment.world_from_camera;
    let members = nearby_keyframes(input, &found, usize::MAX);
    let guess = Prediction { world_from_camera: found, ..*guess };
    let second = align_to(input, aligner, members, input.samples, &guess);
    let fit = acceptance::strict(&second.alignment).ok()?;
    Some((second, fit))
}

/// An even choice of about `n` samples.
pub(crate) fn every_nth(samples: &[Sample], n: usize) -> Vec<Sample> {
    let step = samples.len().div_ceil(n).max(1);
    samples.iter().step_by(step).copied().collect()
}

/// Keyframes that may share something of a view, nearest first.
pub(crate) fn nearby_keyframes(input: &TrackingInput<'_>, view: &Pose, at_most: usize) -> Vec<Member> {
    let near = window::near(&input.map, &covisibility::LIMITS, view);
    let size = input.context.mapping.window.size as usize;
    near.into_iter().take(at_most.min(size)).map(|(_, id)| Member::Keyframe(id)).collect()
}

/// The first member of the window about a pose whose surface is at hand: its newest reference.
pub(crate) fn newest_reference<'a>(
    input: &TrackingInput<'a>,
    world_from_camera: &Pose,
) -> Option<Reference<'a>> {
    let members = window::select(&input.map, &input.context.mapping.window, world_from_camera);
    members.into_iter().find_map(|member| reference(input, member))
}

/// Support of a pose, without solving for anything: samples that it brings onto the reference, less
/// those that it brings into free space in front of it.
pub(crate) fn support(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    samples: &[Sample],
    reference: &Reference<'_>,
    world_from_camera: &Pose,
) -> f64 {
    let report = aligner.try_pose(input.context, samples, reference, world_from_camera);
    f64::from(report.n_matches) - f64::from(report.n_in_front)
}

pub(crate) fn reference<'a>(input: &TrackingInput<'a>, member: Member) -> Option<Reference<'a>> {
    let surfaces = &input.surfaces;
    let mut context = Cow::Borrowed(input.context);
    let (pose, velocity, key, surface, features, session) = match member {
        Member::Recent(place) => {
            let recent = &input.map.state().recent[place];
            let seen = surfaces.recent.iter().find(|s| s.index == recent.index)?;
            let key = (false, recent.index);
            // A repeated image shows what was there a frame before.
            let features = if recent.repeats_colour { &[] } else { seen.features };
            (&recent.world_from_camera, &recent.velocity, key, seen.surface, features, None)
        }
        Member::Keyframe(id) => {
            let keyframe = input.map.keyframe(id)?;
            if !input.map.is_at_hand(keyframe, input.frame.stamp_nanos) {
                return None;
            }
            // A keyframe made at this step is not in the store yet: as long as its frame is recent, its
            // surface is that of the frame, not yet rounded, and has the frame's key.
            let is_own = input.map.is_own(keyframe);
            let fresh = surfaces.recent.iter().find(|s| is_own && s.index == keyframe.frame_index);
            context = input.context.of(keyframe.session);
            let (key, surface, features) = match fresh {
                Some(seen) => ((false, seen.index), seen.surface, seen.features),
                None => {
                    let vertices = surfaces.keyframes.vertices(id);
                    let surface = SurfaceView { grid: context.grid, vertices };
                    ((true, u64::from(id)), surface, surfaces.keyframes.features(id))
                }
            };
            let session = Some(keyframe.session);
            (&keyframe.world_from_camera, &keyframe.velocity, key, surface, features, session)
        }
    };
    let velocity = Twist::from_vector(&Vector6::from_column_slice(velocity));
    Some(Reference {
        world_from_camera: Pose::from(pose),
        key,
        surface,
        session,
        shutter: context.shutter(&velocity),
        velocity,
        features,
        pair: None,
    })
}
