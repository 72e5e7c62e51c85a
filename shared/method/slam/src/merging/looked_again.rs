//! Neighbours of a keyframe as further evidence for the place that it shows in another component (method 12.9).

use crate::evidence::pose_agreement::UncertainPose;
use crate::map::records::SightingRecord;
use crate::map::state::KeyframeState;
use crate::submaps::join;
use crate::tracking::alignment::Aligner;
use crate::tracking::found_place::{self, Shown};
use crate::tracking::input::TrackingInput;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::reference;
use tessera_geometry::{Pose, Twist, Vector6};

/// What a neighbour shows of a sighting.
pub(super) enum LookedAgain {
    /// The same, by so much evidence, of which a share is new.
    Shows { nats: f64, novelty: f64 },
    /// It is at another place of the same component.
    ElsewhereThere,
}

/// What a neighbour shows of a sighting, beside the keyframes that were counted; `None` where it does not see the place.
pub(super) fn looked_again(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    neighbour: &KeyframeState,
    sighting: &SightingRecord,
    counted: &[u32],
) -> Option<LookedAgain> {
    let pose = Pose::from(&neighbour.world_from_camera);
    let expected = join::other_from_own(input, sighting)? * pose;
    let velocity = Twist::from_vector(&Vector6::from_column_slice(&neighbour.velocity));
    let found = join::seen_at(input, aligner, sighting.seen, &expected, velocity)?;
    let uncertain = UncertainPose::read(&neighbour.world_from_camera, &neighbour.covariance)?;
    if join::coincides(input, aligner, &found, (sighting, &expected), &uncertain) != Some(true) {
        return Some(LookedAgain::ElsewhereThere);
    }
    let shown = found_place::shown(&input.in_submap(found.submap), aligner, &found)?;
    let novelty = match shown {
        Shown::SurfacesAlone => 1.0,
        Shown::Evidence(_) => counted
            .iter()
            .filter_map(|&id| reference(input, Member::Keyframe(id)))
            .map(|before| found_place::novelty_beside(input, aligner, &before, &pose))
            .fold(1.0, f64::min),
    };
    Some(LookedAgain::Shows { nats: shown.llr_nats(), novelty })
}
