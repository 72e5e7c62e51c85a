//! Posterior of the depth units over the usual ones and the stated ones.

use crate::judge::RUNS_PER_FALSE_ALARM;
use crate::judge::lattice::Lattice;
use serde::Serialize;

/// Depth units of cameras and data sets, a metre, and their shares among those that a camera can have.
const USUAL: [(f64, f64); 7] = [
    (1000.0, 0.6),
    (5000.0, 0.25),
    (10_000.0, 0.04),
    (4000.0, 0.04),
    (2000.0, 0.03),
    (6553.5, 0.03),
    (256.0, 0.01),
];
/// Share of the units that ground truth finds and that are not usual ones.
const OTHER_SHARE: f64 = 0.02;
/// Units within this factor of each other are taken for the same.
const SAME: f64 = 1.2;
/// Factor on the required likelihood ratio where the stated units are not usual ones.
const UNUSUAL: f64 = 0.1;
/// Median depth of a recording: log-normal about 1.5 m with this deviation, so that 0.2 m (a table, an object)
/// and 11 m (a hall) are within two deviations and never refute units by themselves.
const TYPICAL_M: f64 = 1.5;
const TYPICAL_SIGMA: f64 = 1.0;
/// Steps of disparity of the PrimeSense design (Kinect v1, Xtion, Astra): 580 px x 0.075 m x 8 steps a pixel
/// (Khoshelham and Elberink 2012), per metre; and how they differ between cameras (focal length 525 to 600 px;
/// 0.0029 on fr1_desk_200, fr1_rpy_400 and kitchen_450, 0.0032 in the world room).
const PRIMESENSE_Q: f64 = 1.0 / (580.0 * 0.075 * 8.0);
const PRIMESENSE_SIGMA: f64 = 0.05;
/// Share of that design among sensors whose steps grow strictly with the square of depth; the others,
/// stereo cameras, have steps about this large (focal length 380 to 640 px, baseline 50 to 95 mm, 32 steps).
const PRIMESENSE_SHARE: f64 = 0.7;
const STEREO_Q: f64 = 0.0011;
const STEREO_SIGMA: f64 = 0.6;
/// Nearest depth of a sensor, metres (RealSense D435: 0.105, D405: 0.07; Kinect v1: 0.35; time of flight: 0.1
/// and more), and the share of recordings with a fiftieth of their depth below it.
const NEAREST_M: f64 = 0.09;
const NEARER_SHARE: f64 = 0.002;
/// Deviation of the logarithm of a length against the ground truth where a factor explains the error.
const TRUTH_SIGMA: f64 = 0.2;

/// What bears on the units.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UnitsEvidence {
    /// Stated raw depth of a metre.
    pub stated: f64,
    /// Median depth with the stated units, metres.
    pub median_m: Option<f64>,
    /// Depth with the stated units that a fiftieth is nearer than, metres.
    pub near_m: Option<f64>,
    /// Steps of depth.
    pub lattice: Option<Lattice>,
    /// True lengths over the estimated ones, where such a factor explains the error against ground truth.
    pub true_scale: Option<f64>,
}

/// What all evidence together finds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UnitsPosterior {
    /// The likeliest units other than the stated ones.
    pub likely: f64,
    /// How many times better other units explain the evidence than the stated ones.
    pub likelihood_ratio: f64,
    /// The stated ones are refuted: right ones would be in one run of
    /// [`crate::judge::RUNS_PER_FALSE_ALARM`] at most.
    pub is_wrong: bool,
}

impl UnitsPosterior {
    /// The likely units in words.
    pub fn likely_words(&self) -> String {
        let is_usual = USUAL.iter().any(|(units, _)| *units == self.likely);
        if is_usual { self.likely.to_string() } else { format!("about {}", self.likely) }
    }
}

fn is_same(a: f64, b: f64) -> bool {
    (a / b).max(b / a) < SAME
}

/// Judges stated units; `None` where nothing bears on them.
///
/// The likelihood of other units, averaged over the usual ones by their shares, is divided by that of the
/// stated ones. With right units that ratio is 1 on average, so by Markov's inequality it exceeds a number in
/// one run of that number at most.
pub fn judge_units(evidence: &UnitsEvidence) -> Option<UnitsPosterior> {
    let stated = evidence.stated;
    if !(stated > 0.0 && stated.is_finite()) {
        return None;
    }
    let found = evidence.true_scale.filter(|scale| *scale > 0.0).map(|scale| stated / scale);
    let found = found.filter(|found| !USUAL.iter().any(|(units, _)| is_same(*units, *found)));
    let others = USUAL.into_iter().chain(found.map(|units| (units.round(), OTHER_SHARE)));
    let others: Vec<(f64, f64)> = others.filter(|(units, _)| !is_same(*units, stated)).collect();
    let share: f64 = others.iter().map(|(_, share)| share).sum();
    let here = log_likelihood(evidence, stated);
    let weighed = others.iter().map(|(units, weight)| {
        (*units, weight / share * libm::exp((log_likelihood(evidence, *units) - here).min(600.0)))
    });
    let weighed: Vec<(f64, f64)> = weighed.collect();
    let likelihood_ratio: f64 = weighed.iter().map(|(_, weight)| weight).sum();
    let (likely, _) = weighed.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let is_usual = USUAL.iter().any(|(units, _)| is_same(*units, stated));
    let limit = f64::from(RUNS_PER_FALSE_ALARM) * if is_usual { 1.0 } else { UNUSUAL };
    Some(UnitsPosterior { likely, likelihood_ratio, is_wrong: likelihood_ratio > limit })
}

fn log_likelihood(evidence: &UnitsEvidence, units: f64) -> f64 {
    // A length with the stated units times this is one with these.
    let factor = evidence.stated / units;
    let square = |x: f64| -0.5 * x * x;
    let median = evidence.median_m.map_or(0.0, |m| square(libm::log(m * factor / TYPICAL_M) / TYPICAL_SIGMA));
    let near =
        evidence.near_m.map_or(0.0, |m| if m * factor < NEAREST_M { libm::log(NEARER_SHARE) } else { 0.0 });
    let lattice = evidence.lattice.map_or(0.0, |lattice| {
        let q = lattice.q_per_raw * units;
        let density = |about: f64, sigma: f64| libm::exp(square(libm::log(q / about) / sigma)) / sigma;
        let primesense_sigma = libm::hypot(PRIMESENSE_SIGMA, lattice.spread);
        let density = PRIMESENSE_SHARE * density(PRIMESENSE_Q, primesense_sigma)
            + (1.0 - PRIMESENSE_SHARE) * density(STEREO_Q, STEREO_SIGMA);
        libm::log(density.max(1e-12))
    });
    let truth =
        evidence.true_scale.filter(|s| *s > 0.0).map_or(0.0, |s| square(libm::log(s / factor) / TRUTH_SIGMA));
    median + near + lattice + truth
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(evidence: UnitsEvidence) -> UnitsPosterior {
        judge_units(&evidence).unwrap()
    }

    fn kinect(true_units: f64, stated: f64, median_m: f64) -> UnitsEvidence {
        let lattice = Some(Lattice { q_per_raw: 0.00288 / true_units, spread: 0.01 });
        let median_m = Some(median_m * true_units / stated);
        UnitsEvidence { stated, median_m, lattice, ..UnitsEvidence::default() }
    }

    #[test]
    fn distances_alone_refute_no_usual_units() {
        for median_m in [0.2, 0.25, 0.4, 1.0, 4.0, 8.0, 14.0] {
            for stated in [1000.0, 5000.0, 10_000.0] {
                let evidence = UnitsEvidence {
                    stated,
                    median_m: Some(median_m),
                    near_m: Some(0.6 * median_m),
                    ..UnitsEvidence::default()
                };
                let found = judged(evidence);
                assert!(!found.is_wrong, "{median_m} m in {stated}: {found:?}");
            }
        }
    }

    #[test]
    fn a_kinect_tells_its_units_by_its_steps() {
        for (truth, stated) in [(1000.0, 5000.0), (1000.0, 200.0), (5000.0, 25_000.0)] {
            let found = judged(kinect(truth, stated, 1.5));
            assert!(found.is_wrong && found.likely == truth, "{truth} as {stated}: {found:?}");
        }
        for units in [1000.0, 5000.0] {
            for median_m in [0.25, 1.5, 9.0] {
                assert!(!judged(kinect(units, units, median_m)).is_wrong, "{units}");
            }
        }
    }

    #[test]
    fn a_stereo_camera_with_right_units_raises_no_alarm() {
        for q in [0.0005, 0.00086, 0.0011, 0.0016, 0.002] {
            let lattice = Some(Lattice { q_per_raw: q / 1000.0, spread: 0.02 });
            let evidence =
                UnitsEvidence { stated: 1000.0, median_m: Some(0.4), lattice, ..UnitsEvidence::default() };
            assert!(!judged(evidence).is_wrong, "{q}: {:?}", judge_units(&evidence));
        }
    }

    #[test]
    fn what_is_nearer_than_a_sensor_sees_speaks_against_the_units() {
        let evidence = UnitsEvidence {
            stated: 5000.0,
            median_m: Some(0.2),
            near_m: Some(0.08),
            ..UnitsEvidence::default()
        };
        let found = judged(evidence);
        assert!(found.is_wrong && found.likely == 1000.0, "{found:?}");
    }

    #[test]
    fn ground_truth_names_the_units() {
        let found = |scale| {
            judged(UnitsEvidence { stated: 1000.0, true_scale: Some(scale), ..UnitsEvidence::default() })
        };
        assert_eq!((found(5.02).likely_words(), found(5.02).is_wrong), ("about 199".to_owned(), true));
        assert_eq!((found(0.21).likely_words(), found(0.21).is_wrong), ("5000".to_owned(), true));
        assert!(!found(1.0).is_wrong && !found(1.2).is_wrong);
    }

    #[test]
    fn no_units_are_no_judgement() {
        assert_eq!(judge_units(&UnitsEvidence::default()), None);
    }
}
