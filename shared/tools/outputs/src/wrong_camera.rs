//! Reasons of a verdict that lie in the camera file: wrong depth units, a wrong lens.

use crate::facts::Facts;
use crate::verdict::{Grade, Reason, reason};

/// Factor of lengths against the ground truth from which on the units are wrong.
const WRONG_UNITS: f64 = 2.0;
/// Depth units of cameras and data sets, a metre.
const USUAL_UNITS: [f64; 6] = [256.0, 1000.0, 2000.0, 4000.0, 5000.0, 10_000.0];
/// Error of the positions against the ground truth from which on they are doubtful: metres, and as a share
/// of how far the motion extends.
const OFF_TRUTH_M: f64 = 0.1;
const OFF_TRUTH_SHARE: f64 = 0.1;
/// Relative difference of focal lengths from which on the lens is wrong.
const WRONG_LENS: f64 = 0.04;
/// The same where features say it.
const WRONG_SEEN_LENS: f64 = 0.07;
/// The same where colour is of another camera, whose focal length differs from that of depth by more than
/// the share behind it: its distortion is not known, and is taken for a longer focal length, by up to 7 %.
const WRONG_OTHER_LENS: f64 = 0.12;
const OTHER_LENS: f64 = 0.02;
/// Standard deviations of that difference at least, and pairs of keyframes.
const CERTAIN_SIGMAS: f64 = 5.0;
const LEAST_PAIRS: usize = 8;
/// Relative difference of motions across the view from the true ones from which on the lens is wrong, their
/// standard deviations at least, and the largest deviation: a wrong lens scatters them too.
const WRONG_ACROSS: f64 = 0.08;
const CERTAIN_ACROSS_SIGMAS: f64 = 2.0;
const MOST_ACROSS_SIGMA: f64 = 0.07;
const LENS_ADVICE: &str = "give the right camera: --camera NAME|FILE, or tessera calibrate";

/// What the ground truth says of the depth units.
pub(crate) fn units(facts: &Facts) -> Option<Reason> {
    let truth = facts.truth?;
    let scale = truth.scale;
    // A wrong lens makes a motion that turns any length; wrong units leave the lens as it is.
    if !truth.is_telling || seen_lens(facts).is_some() || (1.0 / WRONG_UNITS..=WRONG_UNITS).contains(&scale) {
        return None;
    }
    let units = facts.units_per_metre;
    let likely = likely_units(units / scale);
    let likely = if USUAL_UNITS.contains(&likely) { likely.to_string() } else { format!("about {likely}") };
    let found = format!(
        "against the ground truth all lengths are {:.2} times too {}: units_per_metre = {units} is wrong, {likely} is likely",
        scale.max(1.0 / scale),
        if scale > 1.0 { "small" } else { "large" },
    );
    Some(reason(Grade::Failed, found, "the right units_per_metre in the camera file (docs/own_camera.md)"))
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

/// The usual units nearest to what was measured.
fn likely_units(measured: f64) -> f64 {
    let ratio = |units: f64| (units / measured).max(measured / units);
    let nearest = USUAL_UNITS.into_iter().min_by(|a, b| ratio(*a).total_cmp(&ratio(*b)));
    nearest.filter(|units| ratio(*units) < 1.2).unwrap_or(measured.round())
}

/// What the refinement of the camera says of its focal length.
pub(crate) fn lens(facts: &Facts) -> Option<Reason> {
    let [from, to] = facts.refined_focal_px?;
    let off = (to - from) / from;
    if !(off.abs() > WRONG_LENS) {
        return None;
    }
    let found = format!(
        "the frames fit a focal length of {to:.0} px better than the camera's {from:.0} px ({:+.0} %)",
        100.0 * off
    );
    Some(reason(Grade::Doubtful, found, "run again with --camera camera_refined.toml, or tessera calibrate"))
}

/// What the features of the colour images say of the focal length.
pub(crate) fn seen_lens(facts: &Facts) -> Option<Reason> {
    let seen = facts.seen_focal.filter(|seen| seen.n_pairs >= LEAST_PAIRS)?;
    let off = seen.ratio - 1.0;
    let is_other = (facts.colour_focal_ratio - 1.0).abs() > OTHER_LENS;
    let limit = if is_other { WRONG_OTHER_LENS } else { WRONG_SEEN_LENS };
    if !(off.abs() > limit && off.abs() > CERTAIN_SIGMAS * seen.sigma) {
        return None;
    }
    let found = format!(
        "the features of turned views fit a focal length of {:.0} px (deviation {:.0} px), not the camera's {:.0} px ({:+.0} %)",
        seen.ratio * facts.focal_px,
        seen.sigma * facts.focal_px,
        facts.focal_px,
        100.0 * off
    );
    Some(reason(Grade::Doubtful, found, LENS_ADVICE))
}

/// What the ground truth says of the focal length, where it finds all lengths right.
pub(crate) fn true_lens(facts: &Facts) -> Option<Reason> {
    let lateral = facts.truth.filter(|_| units(facts).is_none())?.lateral?;
    let off = lateral.scale - 1.0;
    let is_certain = lateral.sigma < MOST_ACROSS_SIGMA && off.abs() > CERTAIN_ACROSS_SIGMAS * lateral.sigma;
    if !(off.abs() > WRONG_ACROSS && is_certain) {
        return None;
    }
    let found = format!(
        "against the ground truth motions across the view are {:.2} times as long as they should be: a focal length of about {:.0} px is likely, not the camera's {:.0} px",
        lateral.scale,
        lateral.scale * facts.focal_px,
        facts.focal_px
    );
    Some(reason(Grade::Doubtful, found, LENS_ADVICE))
}
