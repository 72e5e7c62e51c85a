//! A frame's evidence of the noise scales and of the colour model (method 9.5, 14.4).

use crate::estimation::colour_model::{ColourModel, ColourPoseRecord};
use crate::estimation::colour_pose::ParameterSums;
use crate::estimation::noise_scales::{NoiseRecord, NoiseScales};
use crate::estimation::student::SIX_AXES;
use crate::pairs::colour_coupling::coupling;
use crate::pairs::weighted_pair::WeightedPair;
use tessera_geometry::{Matrix6, Pose, Twist, Vector6};
use tessera_graph::{HalfSums, PairBlock};

/// A pair's surfaces and features, each about the transform that they were found at.
pub(crate) struct PairEvidence<'a> {
    pub(crate) target_from_query: Pose,
    /// Motion per second of query and target, each in its camera frame.
    pub(crate) velocities: [Twist; 2],
    pub(crate) surfaces: (&'a Pose, &'a HalfSums),
    pub(crate) features: Option<&'a WeightedPair>,
}

/// A frame's evidence of the noise scales, and of the colour model where requested.
pub(crate) struct FrameEvidence {
    pub(crate) noise: NoiseRecord,
    pub(crate) colour: Option<ColourPoseRecord>,
}

/// A frame's evidence from all its pairs; `model`: makes the surfaces' sums metric; `colour`: how colour is taken to
/// lie against depth, where that is to be estimated; `None` without a match.
pub(crate) fn evidence<'a>(
    pairs: impl Iterator<Item = PairEvidence<'a>>,
    model: f64,
    scales: &NoiseScales,
    colour: Option<&ColourModel>,
) -> Option<FrameEvidence> {
    let mut of_colour = ParameterSums::default();
    let (mut n_pairs, mut squared_sums, mut redundancy_sums) = (0.0, [0.0; 2], [0.0; 2]);
    let mut variance_factors = 0.0;
    let mut halves = [(Matrix6::zeros(), Vector6::zeros()); 2];
    let mut n_matches = 0;
    for pair in pairs {
        let (origin, sums) = pair.surfaces;
        let both = [&sums.upper, &sums.lower].map(|sums| {
            let (h, g, _) = PairBlock::new(origin, sums).linearise(&pair.target_from_query);
            (h / (model * scales.surfaces), g / (model * scales.surfaces))
        });
        for (sum, half) in halves.iter_mut().zip(&both) {
            *sum = (sum.0 + half.0, sum.1 + half.1);
        }
        n_matches += sums.upper.n + sums.lower.n;
        let surfaces = (both[0].0 + both[1].0, both[0].1 + both[1].1);
        let Some(features) = pair.features else { continue };
        let found = &features.found;
        let (h_f, g_f, _) =
            PairBlock::new(&found.target_from_query, &found.sums).linearise(&pair.target_from_query);
        let features = (h_f / scales.features, g_f / scales.features);
        let Some(Components { squared, redundancy, pull }) = components(&surfaces, &features) else {
            continue;
        };
        n_pairs += 1.0;
        variance_factors += found.variance_factor;
        let weight = SIX_AXES.consistent_weight(squared[0] + squared[1]);
        for (k, scale) in [scales.surfaces, scales.features].into_iter().enumerate() {
            squared_sums[k] += scale * weight * squared[k];
            redundancy_sums[k] += redundancy[k];
        }
        if let Some(colour) = colour {
            let [query, target] = &pair.velocities;
            let coupling = coupling(found, [query, target], colour) / scales.features;
            let joint = surfaces.0 + features.0;
            of_colour.add(&pull, (&features.0, &joint), &coupling, weight);
        }
    }
    // The image's halves by all references: the surfaces by themselves.
    let halves = components(&halves[0], &halves[1]).map_or([0.0; 2], |parts| {
        let squared = parts.squared.iter().sum();
        [scales.surfaces * SIX_AXES.consistent_weight(squared) * squared, parts.redundancy.iter().sum()]
    });
    let divisor = f64::max(n_pairs, 1.0);
    let noise = NoiseRecord {
        halves,
        squared: squared_sums.map(|sum| sum / divisor),
        redundancy: redundancy_sums.map(|sum| sum / divisor),
        variance_factor: [variance_factors / divisor, f64::min(n_pairs, 1.0)],
        step_variance: None,
    };
    of_colour.information /= divisor;
    of_colour.gradient /= divisor;
    let colour = colour.filter(|_| n_pairs > 0.0).map(|model| ColourPoseRecord::new(&of_colour, model));
    (n_matches > 0).then_some(FrameEvidence { noise, colour })
}

/// Two groups of normal equations at their joint optimum.
struct Components {
    /// Squared disagreement of each.
    squared: [f64; 2],
    redundancy: [f64; 2],
    /// Gradient of the first.
    pull: Vector6,
}

/// Squared disagreement and redundancy of two groups of normal equations `(N, g)` at their joint optimum.
fn components(a: &(Matrix6, Vector6), b: &(Matrix6, Vector6)) -> Option<Components> {
    let joint = (a.0 + b.0).cholesky()?;
    let x = -joint.solve(&(a.1 + b.1));
    // The gradients of the two groups there are opposite.
    let pull = a.0 * x + a.1;
    let part = |normal: &Matrix6| {
        // A direction without information has no pull: the floor only keeps the inverse finite.
        let floor = Matrix6::identity() * (1e-9 * normal.trace());
        let squared = pull.dot(&(normal + floor).cholesky()?.solve(&pull));
        Some((squared, 6.0 - joint.solve(normal).trace()))
    };
    let ((qa, ra), (qb, rb)) = (part(&a.0)?, part(&b.0)?);
    Some(Components { squared: [qa, qb], redundancy: [ra, rb], pull })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::noise_scales::NoiseState;
    use crate::pairs::weighted_pair::FeaturePair;
    use nalgebra::{Matrix3, Vector3};
    use std::sync::Arc;
    use tessera_graph::BlockSums;
    use tessera_numerics::SplitMix64;

    /// A standard normal number, by the sum of twelve even ones.
    fn normal(random: &mut SplitMix64) -> f64 {
        (0..12).map(|_| random.next_u64() as f64 / u64::MAX as f64).sum::<f64>() - 6.0
    }

    /// Sums of 60 points whose squared errors are `scale` times as large as their model states; `shape`: information
    /// along each axis over that of `sigma_m`.
    fn sums(random: &mut SplitMix64, sigma_m: f64, scale: f64, shape: [f64; 3]) -> BlockSums {
        let mut sums = BlockSums::default();
        for _ in 0..60 {
            let mut vector = |size: f64| Vector3::from_fn(|_, _| normal(random) * size);
            let a = vector(1.0) + Vector3::new(0.0, 0.0, 2.0);
            let e = vector(sigma_m * scale.sqrt()).component_div(&Vector3::from(shape.map(f64::sqrt)));
            let omega = Matrix3::from_diagonal(&Vector3::from(shape)) / (sigma_m * sigma_m);
            sums.add(&a, &e, &omega);
            sums.n += 1;
        }
        sums
    }

    /// The scales after 1,500 frames of three pairs each.
    fn estimated(planted: NoiseScales, has_features: bool) -> NoiseScales {
        let mut random = SplitMix64::for_frame(7, 1);
        let mut state = NoiseState::default();
        for _ in 0..1500 {
            let identity = Pose::identity();
            let parts: Vec<(HalfSums, WeightedPair)> = (0..3)
                .map(|_| {
                    let mut half = || sums(&mut random, 0.01, planted.surfaces, [0.1, 0.3, 1.0]);
                    let surfaces = HalfSums { upper: half(), lower: half() };
                    let features = sums(&mut random, 0.01, planted.features, [1.0, 1.0, 0.2]);
                    let found = FeaturePair {
                        target_from_query: identity,
                        inliers: Vec::new(),
                        variance_factor: 1.0,
                        sums: features,
                    };
                    (surfaces, WeightedPair::new(Arc::new(found), 1.0, &identity))
                })
                .collect();
            let pairs = parts.iter().map(|(surfaces, features)| PairEvidence {
                target_from_query: identity,
                velocities: [Twist::default(); 2],
                surfaces: (&identity, surfaces),
                features: Some(features),
            });
            let pairs =
                pairs.map(|pair| PairEvidence { features: pair.features.filter(|_| has_features), ..pair });
            state.apply(&evidence(pairs, 1.0, &state.scales(), None).unwrap().noise);
        }
        state.scales()
    }

    #[test]
    fn planted_scales_are_found_each_by_itself() {
        for (surfaces, features) in [(1.0, 1.0), (4.0, 1.0), (1.0, 4.0), (0.3, 2.0), (2.0, 0.7)] {
            let found = estimated(NoiseScales { surfaces, features }, true);
            let alone = estimated(NoiseScales { surfaces, features }, false);
            let is_near = |found: f64, planted: f64| (0.8..1.25).contains(&(found / planted));
            assert!(is_near(alone.surfaces, surfaces), "{surfaces}, surfaces alone: {alone:?}");
            assert!(is_near(found.surfaces, surfaces), "{surfaces} {features}: {found:?}");
            assert!(is_near(found.features, features), "{surfaces} {features}: {found:?}");
        }
    }
}
