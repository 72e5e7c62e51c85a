//! Evidence that a frame is where an alignment has it: of the window's member with most matches, one pair of views.

use crate::evidence::same_place::PlaceEvidence;
use crate::evidence::sequential::SequentialTest;
use crate::map::state::MOST_COASTED_S;
use crate::settings::RelocaliseSettings;
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Reference;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::{WindowAlignment, reference};
use tessera_geometry::Pose;
use tessera_graph::PairBlock;

/// Evidence of a frame for its place.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shown {
    /// Features and surfaces.
    Evidence(PlaceEvidence),
    /// The map has no features, or they are not used: surfaces alone never reach the bounds of the test.
    SurfacesAlone,
}

impl Shown {
    /// Log-likelihood ratio of the place against any other, nats.
    pub(crate) fn llr_nats(&self) -> f64 {
        match self {
            Self::Evidence(evidence) => evidence.llr_nats(),
            // As many frames as the settings ask for.
            Self::SurfacesAlone => {
                SequentialTest::accepted_nats() / f64::from(RelocaliseSettings::CONFIRM_FRAMES)
            }
        }
    }
}

/// Evidence of an alignment; `None` without a member whose surface is at hand.
pub(crate) fn shown(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    found: &WindowAlignment,
) -> Option<Shown> {
    let a = &found.alignment;
    let (place, report) = a.reports.iter().enumerate().max_by_key(|(_, report)| report.n_matches)?;
    let there = reference(input, *found.members.get(place)?)?;
    let pose = &a.world_from_camera;
    let (origin, sums) = a.blocks.get(place)?;
    let at = there.world_from_camera.inverse() * pose;
    let information = PairBlock::new(origin, sums).linearise(&at).0;
    let evidence = PlaceEvidence::of_surfaces(report, &information);
    if is_without_features(input, &there) {
        return Some(Shown::SurfacesAlone);
    }
    let n_seen = [aligner.sight.n_features(), there.features.len()];
    let n_agreeing = aligner.sight.n_agreeing_anywhere(input.context, &there, pose);
    let before = input.view_before.and_then(|before| reference(input, before));
    let n_expected = aligner.sight.n_expected(input.context, before.as_ref(), (&there, &at));
    let agree_near = || aligner.sight.agree_near(input.context, &there, &at);
    Some(Shown::Evidence(evidence.with_features(n_seen, (n_agreeing, n_expected), agree_near)))
}

fn is_without_features(input: &TrackingInput<'_>, there: &Reference<'_>) -> bool {
    !input.context.mapping.features.enabled || !input.context.is_colour_trusted || there.features.is_empty()
}

/// Evidence with which a place among so many is taken up: that it is this one is as likely then as all else, where
/// each of them, and none, had been.
pub(crate) fn least_nats(input: &TrackingInput<'_>) -> f64 {
    libm::log(input.map.active_anywhere().count().max(1) as f64)
}

/// The test with one more frame at the place.
pub(crate) fn with_frame(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    found: &WindowAlignment,
    shown: Shown,
) -> SequentialTest {
    let before = SequentialTest { sum_nats: input.map.state().evidence_nats };
    if matches!(shown, Shown::SurfacesAlone) {
        return before.with(shown.llr_nats(), 1.0);
    }
    let Some((place, last)) = input.map.state().recent.iter().enumerate().next_back() else { return before };
    let novelty = reference(input, Member::Recent(place))
        .map_or(0.0, |last| novelty_beside(input, aligner, &last, &found.alignment.world_from_camera));
    let step_nanos = input.frame.stamp_nanos.saturating_sub(last.stamp_nanos);
    with_view(before, shown.llr_nats(), novelty, step_nanos)
}

/// The test with a view of which a share is new, and the rest seen again after so long.
pub(crate) fn with_view(
    test: SequentialTest,
    llr_nats: f64,
    novelty: f64,
    step_nanos: i64,
) -> SequentialTest {
    // In a second the view of a camera at rest counts once more, and no further: noise, exposure and what moves are others
    // by then. A choice; it bounds the time to find a place from a view that tells half of what is asked.
    let time_share = step_nanos as f64 * 1e-9 / MOST_COASTED_S;
    test.with(llr_nats, novelty).seen_again(llr_nats, time_share - novelty)
}

/// Share of a frame at a pose that a reference did not show.
pub(crate) fn novelty_beside(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    before: &Reference<'_>,
    world_from_camera: &Pose,
) -> f64 {
    1.0 - aligner.try_pose(input.context, input.samples, before, world_from_camera).in_view()
}
