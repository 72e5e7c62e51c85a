//! Acceptance tests of an alignment (method 6).

use crate::pairs::keyframe_pair::MIN_FEATURES;
use crate::settings::WindowSettings;
use crate::tracking::alignment::Alignment;

/// Features that agree with a pose where little of the surface does, at least.
pub(crate) const AGREEING: u32 = 20;

/// Failure tests for a frame whose motion was predicted.
pub(crate) fn tracking(w: &WindowSettings, a: &Alignment) -> Result<(), String> {
    if !a.is_solved {
        return Err("the normal equations could not be solved".into());
    }
    if a.n_agreeing >= AGREEING && Best::of(a).in_front <= w.max_in_front {
        return Ok(());
    }
    if !(a.match_share() >= w.min_match_share) {
        let (found, least) = (100.0 * a.match_share(), 100.0 * w.min_match_share);
        return Err(format!("{found:.1} % of the queries have a match, at least {least:.1} % are needed"));
    }
    if !(a.residual_sigmas() <= w.max_residual_sigmas) {
        let (found, most) = (a.residual_sigmas(), w.max_residual_sigmas);
        return Err(format!(
            "median residual is {found:.2} standard deviations, at most {most:.2} are allowed"
        ));
    }
    let best = Best::of(a);
    if !(best.matched >= w.min_matched && best.in_front <= w.max_in_front) {
        return Err(format!(
            "{best}; at least {:.0} % matched and at most {:.0} % in front are needed",
            100.0 * w.min_matched,
            100.0 * w.max_in_front
        ));
    }
    Ok(())
}

/// Shares and residual against the reference with most matches.
struct Best {
    in_view: f64,
    matched: f64,
    in_front: f64,
    residual_sigmas: f64,
}

impl Best {
    fn of(a: &Alignment) -> Self {
        let best = a.reports.iter().max_by_key(|report| report.n_matches).copied().unwrap_or_default();
        let share = |part: u32, whole: u32| f64::from(part) / f64::from(whole.max(1));
        Self {
            in_view: share(best.n_in_view, best.n_queries),
            matched: share(best.n_matches, best.n_in_view),
            in_front: share(best.n_in_front, best.n_in_view),
            residual_sigmas: f64::from(best.median_residual_sigmas),
        }
    }
}

impl std::fmt::Display for Best {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "{:.0} % of the frame in view, {:.0} % of that matched, {:.1} % in front, median residual {:.2} sigma",
            100.0 * self.in_view,
            100.0 * self.matched,
            100.0 * self.in_front,
            self.residual_sigmas
        )
    }
}

/// Limits of the tests of a frame that may be anywhere, of its best reference (method 12.7).
pub(crate) struct StrictLimits {
    /// Least share of the frame that it sees.
    in_view: f64,
    /// Least share of that part that has a match.
    matched: f64,
    /// Largest share of that part that floats in front of what it saw.
    in_front: f64,
    /// Largest median normal residual, standard deviations of depth.
    residual_sigmas: f64,
}

pub(crate) const STRICT: StrictLimits =
    StrictLimits { in_view: 0.3, matched: 0.5, in_front: 0.1, residual_sigmas: 0.7 };
/// For the first alignment of a candidate.
pub(crate) const COARSE: StrictLimits =
    StrictLimits { in_view: 0.24, matched: 0.35, in_front: 0.2, residual_sigmas: 1.05 };

/// Strict tests, for a frame that may be anywhere: the best reference sees enough of it, nearly all
/// of that matches, and almost nothing violates free space. Both answers hold the numbers.
pub(crate) fn strict(r: &StrictLimits, a: &Alignment) -> Result<String, String> {
    if !a.is_solved {
        return Err("the normal equations could not be solved".into());
    }
    let best = Best::of(a);
    if a.n_agreeing >= MIN_FEATURES && best.in_front <= r.in_front {
        return Ok(format!("{best}, {} features agree", a.n_agreeing));
    }
    let is_good = best.in_view >= r.in_view
        && best.matched >= r.matched
        && best.in_front <= r.in_front
        && best.residual_sigmas <= r.residual_sigmas;
    if is_good { Ok(best.to_string()) } else { Err(best.to_string()) }
}
