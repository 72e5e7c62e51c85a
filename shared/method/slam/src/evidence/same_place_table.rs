//! Weights of [`PlaceEvidence`](crate::PlaceEvidence), fitted to pairs whose answer is known by the example
//! `same_place` (docs/accuracy.md has the sequences and the check on others). Made by that command, not edited.

use crate::evidence::same_place::{WeightStep, WeightTable};

const fn step(quantity: usize, from: f64, nats: f64) -> WeightStep {
    WeightStep { quantity, from, nats }
}

/// Where both views have features.
pub(crate) const WITH_FEATURES: WeightTable = WeightTable {
    constant_nats: -2.01,
    steps: &[
        step(0, 12.0, 3.71),
        step(0, 40.0, 2.40),
        step(0, 80.0, 0.35),
        step(1, 0.05, 3.48),
        step(1, 0.1, 0.28),
        step(2, 0.2, 0.39),
        step(3, 0.4, 1.72),
        step(4, 0.1, -0.50),
        step(4, 0.2, -1.74),
        step(4, 0.4, -1.64),
        step(5, 0.6, -0.05),
        step(5, 0.7, -0.76),
        step(5, 0.8, -1.04),
        step(5, 1.5, -1.23),
        step(6, 0.005, 2.12),
        step(6, 0.01, 0.43),
    ],
};

/// By surfaces alone.
pub(crate) const SHAPE: WeightTable = WeightTable {
    constant_nats: -2.22,
    steps: &[
        step(2, 0.2, 1.01),
        step(3, 0.4, 2.48),
        step(4, 0.05, -0.17),
        step(4, 0.1, -0.73),
        step(4, 0.2, -1.62),
        step(4, 0.4, -1.40),
        step(5, 0.5, -0.17),
        step(5, 0.6, -0.12),
        step(5, 0.7, -0.26),
        step(5, 0.8, -1.34),
        step(5, 1.5, -0.54),
        step(6, 0.005, 1.84),
        step(6, 0.01, 0.52),
        step(6, 0.02, 0.06),
        step(6, 0.05, 0.20),
        step(6, 0.1, 0.19),
    ],
};
