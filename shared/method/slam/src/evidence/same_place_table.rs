//! Weights of [`PlaceEvidence`](crate::PlaceEvidence), fitted to pairs whose answer is known by the example
//! `same_place` (docs/accuracy.md has the sequences and the check on others). Not edited by hand, but for the last table,
//! which is that of an earlier fit.

use crate::evidence::same_place::{WeightStep, WeightTable};

const fn step(quantity: usize, from: f64, nats: f64) -> WeightStep {
    WeightStep { quantity, from, nats }
}

/// Where both views have features.
pub(crate) const WITH_FEATURES: WeightTable = WeightTable {
    constant_nats: -3.43,
    steps: &[
        step(0, 12.0, 2.28),
        step(0, 20.0, 1.25),
        step(0, 40.0, 2.43),
        step(0, 80.0, 0.39),
        step(1, 0.1, 1.83),
        step(1, 0.7, 0.51),
        step(1, 1.0, 0.99),
        step(2, 10.0, -1.54),
        step(2, 20.0, -0.76),
        step(2, 40.0, -0.83),
        step(3, 0.2, 0.42),
        step(4, 0.2, 0.88),
        step(4, 0.3, 2.16),
        step(4, 0.4, 1.25),
        step(5, 0.05, -0.11),
        step(5, 0.1, -0.53),
        step(5, 0.2, -1.19),
        step(5, 0.4, -1.17),
        step(6, 0.5, -0.17),
        step(6, 0.6, -0.70),
        step(6, 0.7, -0.54),
        step(6, 0.8, -0.23),
        step(6, 1.0, -1.00),
        step(6, 1.5, -0.34),
        step(7, 0.005, 1.63),
        step(7, 0.01, 0.21),
        step(7, 0.02, 0.27),
        step(7, 0.05, 0.03),
        step(7, 0.1, 0.04),
    ],
};

/// By surfaces alone.
pub(crate) const SHAPE: WeightTable = WeightTable {
    constant_nats: -3.33,
    steps: &[
        step(3, 0.2, 0.27),
        step(4, 0.2, 0.46),
        step(4, 0.3, 2.20),
        step(4, 0.4, 1.47),
        step(4, 0.5, 0.20),
        step(5, 0.05, -0.44),
        step(5, 0.1, -0.93),
        step(5, 0.2, -1.39),
        step(5, 0.4, -0.51),
        step(6, 0.5, -0.49),
        step(6, 0.6, -0.44),
        step(6, 0.7, -0.21),
        step(6, 1.0, -0.55),
        step(6, 1.5, -0.48),
        step(7, 0.005, 1.88),
        step(7, 0.01, 0.28),
        step(7, 0.02, 0.29),
        step(7, 0.05, 0.18),
        step(7, 0.1, 0.20),
    ],
};

/// By features alone, where the surfaces fit as those of one place do: as fitted to the collection before, whose
/// features and surfaces are the same. The fit to this one has 3.15 nats for 20 missing features in place of 2.32, and
/// two looks at a small image, which describes less than it detects, were a departure.
pub(crate) const ALIKE: WeightTable = WeightTable {
    constant_nats: -0.49,
    steps: &[
        step(0, 12.0, 4.25),
        step(0, 40.0, 2.35),
        step(0, 80.0, 0.12),
        step(1, 0.1, 2.93),
        step(1, 0.7, 2.63),
        step(1, 1.0, 1.00),
        step(2, 20.0, -1.83),
        step(2, 40.0, -0.97),
    ],
};
