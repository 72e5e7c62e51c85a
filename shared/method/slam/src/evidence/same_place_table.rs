//! Weights of [`PlaceEvidence`](crate::PlaceEvidence), fitted to pairs whose answer is known by the example
//! `same_place` (docs/accuracy.md has the sequences and the check on others). Not edited by hand; the missing features of
//! its pairs were computed anew by a script after the pairs were collected, and a fresh collection was not tried.

use crate::evidence::same_place::{WeightStep, WeightTable};

const fn step(quantity: usize, from: f64, nats: f64) -> WeightStep {
    WeightStep { quantity, from, nats }
}

/// Where both views have features.
pub(crate) const WITH_FEATURES: WeightTable = WeightTable {
    constant_nats: -2.18,
    steps: &[
        step(0, 12.0, 1.49),
        step(0, 20.0, 0.84),
        step(0, 40.0, 2.85),
        step(0, 80.0, 0.35),
        step(1, 0.1, 2.66),
        step(1, 0.4, 1.03),
        step(2, 10.0, -0.76),
        step(2, 20.0, -0.75),
        step(2, 40.0, -0.99),
        step(3, 0.2, 1.18),
        step(4, 0.4, 2.19),
        step(5, 0.1, -0.31),
        step(5, 0.2, -1.44),
        step(5, 0.4, -1.90),
        step(6, 0.6, -0.35),
        step(6, 0.7, -0.65),
        step(6, 0.8, -1.09),
        step(6, 1.5, -1.18),
        step(7, 0.005, 1.82),
        step(7, 0.01, 0.54),
    ],
};

/// By surfaces alone.
pub(crate) const SHAPE: WeightTable = WeightTable {
    constant_nats: -2.22,
    steps: &[
        step(3, 0.2, 1.01),
        step(4, 0.4, 2.48),
        step(5, 0.05, -0.17),
        step(5, 0.1, -0.73),
        step(5, 0.2, -1.62),
        step(5, 0.4, -1.40),
        step(6, 0.5, -0.17),
        step(6, 0.6, -0.12),
        step(6, 0.7, -0.26),
        step(6, 0.8, -1.34),
        step(6, 1.5, -0.54),
        step(7, 0.005, 1.84),
        step(7, 0.01, 0.52),
        step(7, 0.02, 0.06),
        step(7, 0.05, 0.20),
        step(7, 0.1, 0.19),
    ],
};

/// By features alone, where the surfaces fit as those of one place do.
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
