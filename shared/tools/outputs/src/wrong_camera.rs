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

/// What the ground truth says of the depth units.
pub(crate) fn units(facts: &Facts) -> Option<Reason> {
    let truth = facts.truth?;
    let scale = truth.scale;
    if !truth.is_telling || (1.0 / WRONG_UNITS..=WRONG_UNITS).contains(&scale) {
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
