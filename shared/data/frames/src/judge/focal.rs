//! Posterior of the focal length, as the logarithm of the true one over the stated one.

use crate::judge::Z;
use serde::Serialize;

/// Standard deviation of a stated focal length about the true one, as a share: error rate of vendors' files
/// (factory calibrations of one model of camera differ by 1 to 2 %: Kinect v1, Khoshelham and Elberink 2012).
const STATED_SIGMA: f64 = 0.015;
/// Mean and standard deviation of what features add, in common to all views of a recording: distortion that
/// is not in the file, colour that is not quite registered, lag and shutter. Fitted to excerpts of 100 frames
/// of kitchen_450 and fr1_desk_200 with what the example `judge_camera` of `shared/tools/offline` prints. The
/// check on fr1_rpy_400, d435_office_400 and the worlds room, corridor, wall and house is not independent: all
/// of them were looked at while this file's constants were adjusted.
const SEEN_BIAS: f64 = 0.019;
const SEEN_FLOOR: f64 = 0.015;
/// Standard deviation of what the matches of one pair of views have in common; fitted as above, and no better checked.
const PAIR_SIGMA: f64 = 0.15;
/// Degrees of freedom that the fitted deviation of a pair weighs against the jackknife's, whose groups are
/// [`JACKKNIFE_GROUPS`].
const PRIOR_FREEDOM: f64 = 4.0;
const JACKKNIFE_GROUPS: f64 = 8.0;
/// Standard deviation of what motions against the ground truth have in common where the camera does not
/// turn. Fitted to kitchen_450 and d435_office_400; kitchen_exact_120, fr1_desk_200 and the worlds room,
/// corridor, wall and house were looked at meanwhile, so that they are no independent check.
const LATERAL_FLOOR: f64 = 0.008;
/// Quantile of chi-square with one degree of freedom, at the rate of false alarms: beyond, two estimates
/// contradict each other.
const CONTRADICTION: f64 = 10.83;
/// Distance of what is seen, metres: a focal length that is off by a share moves the pivot of a turn by this
/// share of it. The geometric mean of indoor depth.
const SEEN_AT_M: f64 = 1.5;
/// Standard deviation of a focal length solved from surfaces, where none is stated: on the shared recordings
/// it stays within this share of the official one, and near its start; and what is added to a stated one
/// (docs/accuracy.md: kitchen_exact_120 and room, to 0.3 %).
const SURFACES_SIGMA: f64 = 0.03;
const SURFACES_FLOOR: f64 = 0.004;
/// Standard deviation of a recording's name: cameras of one name differ by factory calibration alone.
const NAME_SIGMA: f64 = 0.02;

/// Where an estimate of the focal length comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FocalSource {
    /// Features of views that are turned against each other.
    Features,
    /// Motions across the view against the ground truth's.
    GroundTruth,
    /// Surfaces that are seen twice (`--refine-camera`, `calibrate`).
    Surfaces,
    /// The camera that the recording's name or layout names.
    Name,
}

impl FocalSource {
    /// In words, after "by".
    pub fn words(self) -> &'static str {
        match self {
            Self::Features => "features of turned views",
            Self::GroundTruth => "motions across the view against the ground truth",
            Self::Surfaces => "surfaces seen twice",
            Self::Name => "the recording's name",
        }
    }
}

/// One estimate of the logarithm of the true focal length over the stated one, its bias removed; the errors
/// of different estimates are independent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct FocalEvidence {
    /// Where it comes from.
    pub source: FocalSource,
    /// The logarithm.
    pub log_ratio: f64,
    /// Its standard deviation, with what no number of views averages out.
    pub sigma: f64,
}

impl FocalEvidence {
    /// From features: the ratio, its standard deviation by a jackknife over groups of pairs, and the pairs.
    pub fn features(ratio: f64, sigma: f64, n_pairs: usize) -> Self {
        let n = n_pairs.max(1) as f64;
        let (prior, jackknife) = (PAIR_SIGMA * PAIR_SIGMA / n, (sigma / ratio) * (sigma / ratio));
        let freedom = (JACKKNIFE_GROUPS.min(n) - 1.0).max(0.0);
        let pooled = (PRIOR_FREEDOM * prior + freedom * jackknife) / (PRIOR_FREEDOM + freedom);
        let log_ratio = libm::log(ratio) - SEEN_BIAS;
        Self { source: FocalSource::Features, log_ratio, sigma: (pooled + SEEN_FLOOR * SEEN_FLOOR).sqrt() }
    }

    /// From motions across the view over the ground truth's, with the standard deviation of that ratio;
    /// `turn_per_metre`: how much the camera turns while it moves by a metre, radians.
    pub fn ground_truth(ratio: f64, sigma: f64, turn_per_metre: f64) -> Self {
        let of_turn = SEEN_AT_M * turn_per_metre;
        let floor = LATERAL_FLOOR * (1.0 + of_turn * of_turn).sqrt();
        let sampling = sigma / ratio;
        Self {
            source: FocalSource::GroundTruth,
            log_ratio: libm::log(ratio),
            sigma: (sampling * sampling + floor * floor).sqrt(),
        }
    }

    /// From surfaces: the solved focal length over the stated one, and its deviation as a share where it is
    /// known.
    pub fn surfaces(ratio: f64, share: Option<f64>) -> Self {
        let sigma = share.map_or(SURFACES_SIGMA, |share| libm::hypot(share, SURFACES_FLOOR));
        Self { source: FocalSource::Surfaces, log_ratio: libm::log(ratio), sigma }
    }

    /// From the camera that a recording's name tells: its focal length over the stated one.
    pub fn name(ratio: f64) -> Self {
        Self { source: FocalSource::Name, log_ratio: libm::log(ratio), sigma: NAME_SIGMA }
    }
}

/// What all evidence together finds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FocalPosterior {
    /// The true focal length over the stated one by the evidence, without the file.
    pub ratio: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// How far the stated one is off, in standard deviations of both.
    pub sigmas: f64,
    /// The stated one is refuted: at this rate a right file would be (1 in [`crate::judge::RUNS_PER_FALSE_ALARM`]).
    pub is_wrong: bool,
    /// What the ratio is of, the weightiest first.
    pub sources: Vec<FocalSource>,
}

impl FocalPosterior {
    /// The finding in one sentence, of a stated focal length in pixels.
    pub fn words(&self, stated_px: f64) -> String {
        let sources: Vec<&str> = self.sources.iter().map(|source| source.words()).collect();
        format!(
            "a focal length of about {:.0} px (deviation {:.0} px) is likely, not the camera's {stated_px:.0} px ({:+.0} %), by {}",
            self.ratio * stated_px,
            self.sigma * stated_px,
            100.0 * (self.ratio - 1.0),
            sources.join(" and ")
        )
    }
}

/// Judges a stated focal length; `None` without evidence.
///
/// The evidence is averaged by its variances; where it contradicts itself beyond chance its deviation grows by
/// the root of chi-square (Birge 1932). The file is refuted where that mean lies beyond the quantile `Z`
/// under "the file is right".
pub fn judge_focal(evidence: &[FocalEvidence]) -> Option<FocalPosterior> {
    let usable = |e: &&FocalEvidence| e.log_ratio.is_finite() && e.sigma.is_finite() && e.sigma > 0.0;
    let mut evidence: Vec<&FocalEvidence> = evidence.iter().filter(usable).collect();
    evidence.sort_by(|a, b| a.sigma.total_cmp(&b.sigma));
    let weight: f64 = evidence.iter().map(|e| e.sigma.powi(-2)).sum();
    if evidence.is_empty() {
        return None;
    }
    let mean = evidence.iter().map(|e| e.log_ratio * e.sigma.powi(-2)).sum::<f64>() / weight;
    let squares: f64 = evidence.iter().map(|e| ((e.log_ratio - mean) / e.sigma).powi(2)).sum();
    let excess = squares / (CONTRADICTION * (evidence.len() as f64 - 1.0).max(1.0));
    // Where the estimates contradict each other, no weight is right: as far apart as they are.
    let variance = if excess > 1.0 { squares / weight } else { 1.0 / weight };
    let sigmas = mean.abs() / (variance + STATED_SIGMA * STATED_SIGMA).sqrt();
    let ratio = libm::exp(mean);
    Some(FocalPosterior {
        ratio,
        sigma: ratio * variance.sqrt(),
        sigmas,
        is_wrong: sigmas > Z,
        sources: evidence.iter().map(|e| e.source).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(evidence: &[FocalEvidence]) -> FocalPosterior {
        judge_focal(evidence).unwrap()
    }

    #[test]
    fn without_evidence_there_is_no_judgement() {
        assert_eq!(judge_focal(&[]), None);
        assert_eq!(judge_focal(&[FocalEvidence::features(f64::NAN, 0.01, 20)]), None);
    }

    /// Estimates of excerpts of the shared recordings with their own cameras: ratio, deviation, pairs.
    #[test]
    fn estimates_of_right_cameras_raise_no_alarm() {
        let seen: [(f64, f64, usize); 8] = [
            (0.0427, 0.0061, 29),
            (-0.0284, 0.0126, 29),
            (0.0424, 0.0086, 53),
            (0.0621, 0.0070, 26),
            (-0.0724, 0.0145, 9),
            (-0.0187, 0.0096, 8),
            (0.0630, 0.0144, 27),
            (0.0934, 0.042, 9),
        ];
        for (log_ratio, sigma, n_pairs) in seen {
            let found = judged(&[FocalEvidence::features(log_ratio.exp(), sigma, n_pairs)]);
            assert!(!found.is_wrong, "{log_ratio}: {found:?}");
        }
    }

    #[test]
    fn ten_percent_are_found_where_the_camera_turns() {
        for log_ratio in [0.1017_f64, -0.0911, 0.1226, -0.0791] {
            let found = judged(&[FocalEvidence::features(log_ratio.exp(), 0.0025, 70)]);
            assert!(found.is_wrong, "{log_ratio}: {found:?}");
        }
    }

    #[test]
    fn a_deviation_that_is_stated_too_small_is_not_believed() {
        let found = judged(&[FocalEvidence::features(1.05, 1e-6, 80)]);
        assert!(!found.is_wrong && found.sigma > 0.015, "{found:?}");
    }

    #[test]
    fn evidence_adds_up_and_contradictions_widen() {
        let truth = FocalEvidence::ground_truth(1.1, 0.03, 0.5);
        let surfaces = FocalEvidence::surfaces(1.08, None);
        assert!(!judged(&[truth]).is_wrong && !judged(&[surfaces]).is_wrong);
        let both = judged(&[surfaces, truth, FocalEvidence::features(1.1, 0.01, 20)]);
        assert!(both.is_wrong && both.sources.len() == 3, "{both:?}");
        let torn = judged(&[
            FocalEvidence::features(1.15, 0.002, 60),
            FocalEvidence::ground_truth(0.93, 0.005, 0.1),
        ]);
        assert!(!torn.is_wrong && torn.sigma > 0.07, "{torn:?}");
    }

    #[test]
    fn a_turning_camera_has_no_ground_truth_of_its_focal_length() {
        assert!(!judged(&[FocalEvidence::ground_truth(1.127, 0.02, 5.0)]).is_wrong);
        assert!(judged(&[FocalEvidence::ground_truth(1.127, 0.02, 0.2)]).is_wrong);
    }

    #[test]
    fn the_sentence_has_the_values() {
        let words = judged(&[FocalEvidence::name(0.9)]).words(500.0);
        assert!(words.starts_with("a focal length of about 450 px (deviation 9 px) is likely, not the camera's 500 px (-10 %), by the recording's name"), "{words}");
    }
}
