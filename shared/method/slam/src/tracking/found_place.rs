//! Evidence that a frame is where an alignment has it: of the window's member with most matches, one pair of views.

use crate::evidence::same_place::PlaceEvidence;
use crate::evidence::sequential::SequentialTest;
use crate::tracking::alignment::Aligner;
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Reference;
use crate::tracking::window::Member;
use crate::tracking::window_alignment::{WindowAlignment, reference};
use tessera_graph::PairBlock;

/// Time in which the view of a camera at rest counts once more, nanoseconds: what moves, exposure and noise change,
/// the place does not.
const SEEN_AGAIN_NANOS: f64 = 10e9;

/// What a frame shows of its place.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shown {
    /// A log-likelihood ratio, nats.
    Evidence(f64),
    /// Neither the frame nor the map has features: surfaces alone never reach the bounds of the test.
    SurfacesAlone,
}

/// What an alignment shows; `None` without a member whose surface is at hand.
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
    Some(Shown::Evidence(evidence.with_features(n_seen, n_agreeing).llr_nats()))
}

fn is_without_features(input: &TrackingInput<'_>, there: &Reference<'_>) -> bool {
    let has_none = input.frame.features.is_empty() && there.features.is_empty();
    !input.context.mapping.features.enabled || !input.context.is_colour_trusted || has_none
}

/// Evidence with which a place among so many is taken up: that it is this one is as likely then as all else, where
/// each of them, and none, had been.
pub(crate) fn least_nats(input: &TrackingInput<'_>) -> f64 {
    libm::log(input.map.active_anywhere().count().max(1) as f64)
}

/// The test with the frame that found the place.
pub(crate) fn first(input: &TrackingInput<'_>, shown: Shown) -> SequentialTest {
    SequentialTest::default().with(nats(input, shown), 1.0)
}

fn nats(input: &TrackingInput<'_>, shown: Shown) -> f64 {
    match shown {
        Shown::Evidence(llr_nats) => llr_nats,
        // As many frames as the settings ask for.
        Shown::SurfacesAlone => {
            SequentialTest::accepted_nats() / f64::from(input.context.mapping.relocalise.confirm_frames)
        }
    }
}

/// The test with one more frame at the place.
pub(crate) fn with_frame(
    input: &TrackingInput<'_>,
    aligner: &mut Aligner,
    found: &WindowAlignment,
    shown: Shown,
) -> SequentialTest {
    let before = SequentialTest { sum_nats: input.map.state().evidence_nats };
    let novelty = match shown {
        Shown::Evidence(_) => novelty(input, aligner, found),
        Shown::SurfacesAlone => 1.0,
    };
    before.with(nats(input, shown), novelty)
}

/// Share of a frame that the one before did not show, and a little for the time between them.
fn novelty(input: &TrackingInput<'_>, aligner: &mut Aligner, found: &WindowAlignment) -> f64 {
    let recent = &input.map.state().recent;
    let Some((place, last)) = recent.iter().enumerate().next_back() else { return 0.0 };
    let seconds_share = input.frame.stamp_nanos.saturating_sub(last.stamp_nanos) as f64 / SEEN_AGAIN_NANOS;
    let Some(before) = reference(input, Member::Recent(place)) else { return seconds_share };
    let pose = &found.alignment.world_from_camera;
    let report = aligner.try_pose(input.context, input.samples, &before, pose);
    let overlap = f64::from(report.n_in_view) / f64::from(report.n_queries.max(1));
    seconds_share.max(1.0 - overlap)
}
