//! Reasons of a verdict that lie in the camera file: wrong depth units, a wrong lens. Both are found by the
//! judge of the camera (`tessera_sources::judge`); here its evidence is collected.

use crate::facts::Facts;
use crate::truth::Turns;
use crate::verdict::{Grade, Reason, reason};
use tessera_sources::judge::{FocalEvidence, FocalPosterior, UnitsEvidence, judge_focal, judge_units};
use tessera_sources::judge::{UnitsPosterior, student_inflation};

/// Error of the positions against the ground truth from which on they are doubtful: metres, and as a share
/// of how far the motion extends.
const OFF_TRUTH_M: f64 = 0.1;
const OFF_TRUTH_SHARE: f64 = 0.1;
/// Share within which a factor is a thousand.
const THOUSAND: f64 = 0.1;
const LENS_ADVICE: &str = "give the right camera: --camera NAME|FILE, or tessera calibrate";
const REFINED_ADVICE: &str = "run again with --camera camera_refined.toml, or tessera calibrate";

/// The judge of the focal length, by all that a run tells of it; `None` where nothing does.
pub(crate) fn focal(facts: &Facts) -> Option<FocalPosterior> {
    let features = facts.seen_focal.map(|seen| FocalEvidence::features(seen.ratio, seen.sigma, seen.n_pairs));
    let lateral = facts.lateral.map(|lateral| {
        let sigma = lateral.sigma * student_inflation(lateral.n_groups as f64 - 1.0);
        FocalEvidence::ground_truth(lateral.scale, sigma, lateral.turn_per_metre)
    });
    let surfaces = facts.refined_focal_px.map(|[from, to]| FocalEvidence::surfaces(to / from, None));
    let evidence: Vec<FocalEvidence> = [features, lateral, surfaces].into_iter().flatten().collect();
    judge_focal(&evidence)
}

/// The verdict's reason, where the judge refutes the focal length.
pub(crate) fn lens(facts: &Facts) -> Option<Reason> {
    let found = focal(facts).filter(|found| found.is_wrong)?;
    let advice = if facts.refined_focal_px.is_some() { REFINED_ADVICE } else { LENS_ADVICE };
    Some(reason(Grade::Doubtful, found.words(facts.focal_px), advice))
}

/// The judge of the units, by the ground truth.
fn units_by_truth(facts: &Facts) -> Option<UnitsPosterior> {
    let truth = facts.truth.filter(|truth| truth.is_telling)?;
    // A wrong lens makes a motion that turns any length; wrong units leave the lens as it is.
    if focal(facts).is_some_and(|found| found.is_wrong) {
        return None;
    }
    let evidence = UnitsEvidence {
        stated: facts.units_per_metre,
        true_scale: Some(truth.scale),
        ..UnitsEvidence::default()
    };
    judge_units(&evidence).filter(|found| found.is_wrong)
}

/// What the ground truth tells of the depth units.
pub(crate) fn units(facts: &Facts) -> Option<Reason> {
    let (found, scale, units) = (units_by_truth(facts)?, facts.truth?.scale, facts.units_per_metre);
    // A thousand is no camera's mistake alone: files of poses come in millimetres too.
    let is_thousand = (scale.max(1.0 / scale) / 1000.0 - 1.0).abs() < THOUSAND;
    let or_truth = if is_thousand { "the ground truth is in millimetres, or " } else { "" };
    let found = format!(
        "against the ground truth all lengths are {:.2} times too {}: {or_truth}units_per_metre = {units} is wrong, {} is likely",
        scale.max(1.0 / scale),
        if scale > 1.0 { "small" } else { "large" },
        found.likely_words(),
    );
    Some(reason(Grade::Failed, found, "the right units_per_metre in the camera file (docs/own_camera.md)"))
}

/// What the turns of the ground truth tell: its quaternions are in another order, or one of both is in a mirror.
pub(crate) fn turned_truth(facts: &Facts) -> Option<Reason> {
    let of_order = "the turns of the ground truth fit only if w is at the other end of its quaternions: expected qx qy qz qw, or w first where commas separate whole nanoseconds; errors of rotation and of the end are those of the wrong order";
    let of_mirror = "the turns of the ground truth fit only in a mirror: depth and colour are mirrored, and the map with them, or the ground truth has left-handed axes";
    let (grade, found, advice) = match facts.truth?.turns {
        Turns::AsRead => return None,
        Turns::WAtOtherEnd => (Grade::Good, of_order, ""),
        Turns::Mirrored => {
            (Grade::Doubtful, of_mirror, "images as the camera sees them, both streams turned over")
        }
    };
    Some(reason(grade, found.to_owned(), advice))
}

/// What the ground truth says of the positions, where no factor explains their error.
pub(crate) fn off_truth(facts: &Facts) -> Option<Reason> {
    let truth = facts.truth.filter(|_| units(facts).is_none())?;
    if !(truth.ate_m > OFF_TRUTH_M && truth.ate_m > OFF_TRUTH_SHARE * truth.spread_m) {
        return None;
    }
    let found = format!(
        "against the ground truth positions are off by {:.2} m (root mean square) in a motion that extends over {:.2} m",
        truth.ate_m, truth.spread_m
    );
    let advice = "another --camera, or tessera calibrate; whether the ground truth is this recording's";
    Some(reason(Grade::Doubtful, found, advice))
}
