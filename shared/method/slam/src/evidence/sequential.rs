//! Wald's sequential probability ratio test over views of a place (Wald 1945): log-likelihood ratios add up as far
//! as views are independent.

use crate::estimation::MISSED;

/// Error rate of a wrong relocalisation or join.
const WRONG: f64 = 1e-6;
/// What the evidence so far decides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TestVerdict {
    Accepted,
    Undecided,
    Rejected,
}

/// A sum of log-likelihood ratios, nats.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SequentialTest {
    pub(crate) sum_nats: f64,
}

impl SequentialTest {
    /// The test with one more view; `novelty`: the share of it that no view before it showed. What it shows again
    /// is known already.
    pub(crate) fn with(self, llr_nats: f64, novelty: f64) -> Self {
        Self { sum_nats: self.sum_nats + novelty.clamp(0.0, 1.0) * llr_nats }
    }

    /// The test where the same view was seen for longer by a share of the time in which its noise is another one: it
    /// counts twice at most.
    pub(crate) fn seen_again(self, llr_nats: f64, share: f64) -> Self {
        let again = self.with(llr_nats, share).sum_nats.min(2.0 * llr_nats);
        Self { sum_nats: self.sum_nats.max(again) }
    }

    /// The bound from which on the place is accepted.
    pub(crate) fn accepted_nats() -> f64 {
        libm::log((1.0 - MISSED) / WRONG)
    }

    /// Whether so much evidence, nats, refutes that it is one place.
    pub(crate) fn refutes(sum_nats: f64) -> bool {
        sum_nats <= libm::log(MISSED / (1.0 - WRONG))
    }

    /// The bounds are `ln((1 - MISSED) / WRONG)` and `ln(MISSED / (1 - WRONG))`.
    pub(crate) fn verdict(self) -> TestVerdict {
        if self.sum_nats >= Self::accepted_nats() {
            TestVerdict::Accepted
        } else if Self::refutes(self.sum_nats) {
            TestVerdict::Rejected
        } else {
            TestVerdict::Undecided
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_overwhelming_view_decides_and_the_same_weak_view_again_does_not() {
        let start = SequentialTest::default();
        assert_eq!(start.verdict(), TestVerdict::Undecided);
        assert_eq!(start.with(14.0, 1.0).verdict(), TestVerdict::Accepted);
        let weak = (0..10).fold(start.with(4.0, 1.0), |test, _| test.with(4.0, 0.05));
        assert_eq!(weak.verdict(), TestVerdict::Undecided, "{weak:?}");
        let apart = (0..4).fold(start, |test, _| test.with(4.0, 1.0));
        assert_eq!(apart.verdict(), TestVerdict::Accepted);
        assert_eq!(start.with(-5.0, 1.0).verdict(), TestVerdict::Rejected);
        let at_rest = |llr: f64| (0..100).fold(start.with(llr, 1.0), |test, _| test.seen_again(llr, 0.1));
        assert_eq!(at_rest(8.0).verdict(), TestVerdict::Accepted);
        assert_eq!(at_rest(6.0).sum_nats, 12.0, "it counts twice");
    }
}
