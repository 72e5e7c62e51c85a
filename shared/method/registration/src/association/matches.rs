//! The matches of a pair one by one, for those who need more than their sums.

use crate::association::matcher::Matcher;

/// One correspondence, both frames at their stamps.
#[derive(Clone, Copy, Debug)]
pub struct Match {
    /// Query point in its own frame, metres.
    pub a: [f32; 3],
    /// Residual `b - T a` in the target's frame, metres.
    pub e: [f32; 3],
    /// Query's normal in the target's frame.
    pub na: [f32; 3],
    /// Target's normal.
    pub nb: [f32; 3],
    /// Normal residual in standard deviations of depth, without its sign.
    pub sigmas: f32,
    /// Factor of its cost.
    pub weight: f32,
}

impl Matcher {
    /// The matches of the last call of [`Self::match_pair`].
    pub fn matches(&self) -> Vec<Match> {
        let (found, points) = (&self.found, &self.chosen.points);
        let at = |i: usize| Match {
            a: points.at(i),
            e: found.e.at(i),
            na: found.na.at(i),
            nb: found.nb.at(i),
            sigmas: found.sigmas[i],
            weight: found.weight[i],
        };
        (0..found.len()).filter(|&i| found.weight[i] > 0.0).map(at).collect()
    }
}
