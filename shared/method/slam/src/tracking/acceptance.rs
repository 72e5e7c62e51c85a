//! Acceptance tests of an alignment (method 6).

use crate::estimation::motion_filter::MotionPrior;
use crate::evidence::pose_agreement::FAR_VOLUME;
use crate::evidence::same_place::PlaceEvidence;
use crate::evidence::sequential::SequentialTest;
use crate::map::cause::{Cause, ReferenceFit};
use crate::pairs::keyframe_pair::MIN_FEATURES;
use crate::settings::WindowSettings;
use crate::tracking::alignment::Alignment;
use tessera_registration::PairReport;

/// Failure tests for a frame whose motion was predicted; `motion`: as its last poses have it.
pub(crate) fn tracking(w: &WindowSettings, a: &Alignment, motion: Option<&MotionPrior>) -> Result<(), Cause> {
    if !a.is_solved {
        return Err(Cause::Unsolved);
    }
    let fit = best_fit(a);
    if a.n_agreeing >= MIN_FEATURES && fit.in_front <= w.max_in_front {
        return Ok(());
    }
    let (share, sigmas) = (a.match_share(), a.residual_sigmas());
    if !(share >= w.min_match_share || is_where_it_moved(a, motion)) {
        return Err(Cause::FewMatches { share, least: w.min_match_share });
    }
    if !(sigmas <= w.max_residual_sigmas) {
        return Err(Cause::LargeResidual { sigmas, most: w.max_residual_sigmas });
    }
    if !(fit.matched >= w.min_matched && fit.in_front <= w.max_in_front) {
        let (least_matched, most_in_front) = (w.min_matched, w.max_in_front);
        return Err(Cause::LowSupport { fit, least_matched, most_in_front });
    }
    Ok(())
}

/// Whether the surfaces that match, however few, lie where the motion led by as much evidence as a place is believed on.
fn is_where_it_moved(a: &Alignment, motion: Option<&MotionPrior>) -> bool {
    let Some(motion) = motion else { return false };
    let views_nats = PlaceEvidence::of_surfaces(&best_report(a), &a.information).llr_nats();
    let motion_nats = motion.track_nats(&a.world_from_camera, FAR_VOLUME);
    views_nats + motion_nats >= SequentialTest::accepted_nats()
}

/// Of the reference with most matches.
fn best_report(a: &Alignment) -> PairReport {
    a.reports.iter().max_by_key(|report| report.n_matches).copied().unwrap_or_default()
}

/// Shares and residual against the reference with most matches.
fn best_fit(a: &Alignment) -> ReferenceFit {
    let best = best_report(a);
    ReferenceFit {
        in_view: best.in_view(),
        matched: best.matched_within(),
        in_front: best.in_front(),
        residual_sigmas: f64::from(best.median_residual_sigmas),
        n_agreeing: None,
    }
}

/// Limits of the tests of a frame that may be anywhere, of its best reference (method 12.7).
pub(crate) struct StrictLimits {
    /// Least share of the frame that it sees.
    in_view: f64,
    /// Least share with a match of what falls within its surface.
    matched: f64,
    /// Largest share of that part that floats in front of what it saw.
    pub(crate) in_front: f64,
    /// Largest median normal residual, standard deviations of depth.
    residual_sigmas: f64,
}

pub(crate) const STRICT: StrictLimits =
    StrictLimits { in_view: 0.3, matched: 0.5, in_front: 0.1, residual_sigmas: 0.7 };

/// Strict tests, for a frame that may be anywhere: the best reference sees enough of it, nearly all
/// of that matches, and almost nothing violates free space.
pub(crate) fn strict(a: &Alignment) -> Result<ReferenceFit, Cause> {
    if !a.is_solved {
        return Err(Cause::Unsolved);
    }
    let (r, fit) = (&STRICT, best_fit(a));
    if a.n_agreeing >= MIN_FEATURES && fit.in_front <= r.in_front {
        return Ok(ReferenceFit { n_agreeing: Some(a.n_agreeing), ..fit });
    }
    let is_good = fit.in_view >= r.in_view
        && fit.matched >= r.matched
        && fit.in_front <= r.in_front
        && fit.residual_sigmas <= r.residual_sigmas;
    if is_good { Ok(fit) } else { Err(Cause::NotStrict(fit)) }
}
