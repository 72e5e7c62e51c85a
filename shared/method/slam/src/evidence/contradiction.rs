//! Whether views of two parts of a map contradict each other more often than views of one place do.
//!
//! Views of one place contradict each other now and then: something moved, an edge is thin, an image is blurred. How
//! often, each part tells by itself. Two places that look alike contradict each other besides in what is about them, as
//! what is seen through their doors.

/// Rate at which views of two places that look alike contradict each other, beside that of one place: in 7 to 14 % of
/// pairs of rooms that are furnished alike (example `joins`).
const RATE_OF_TWINS: f64 = 0.1;
/// What is known of the rate in one place before any pair is: one of so many.
const PRIOR_PAIRS: f64 = 50.0;
/// Pairs as which the rate of all views counts in that of one.
const POOLED_PAIRS: f64 = 10.0;

/// What a pair of views tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PairAnswer {
    Agrees,
    Contradicts,
    /// They show too little of the same.
    Silent,
}

/// A pair of views, by their places in one list, and what it tells.
pub(crate) type AskedPair = ((usize, usize), PairAnswer);

/// Log-likelihood ratio of one place against two that look alike, nats. `own`: pairs of views of one part; `across`:
/// pairs of which the first view is of one part and the second of the other. Each first view counts once, however
/// many pairs it is in.
pub(crate) fn one_place_nats(n_views: usize, own: &[AskedPair], across: &[AskedPair]) -> f64 {
    let rates = rates(n_views, own);
    let mut by_view = vec![(0.0, 0.0); n_views];
    for &((first, second), answer) in across {
        // A pair contradicts where either of them does.
        let rate = rates[first].max(rates[second]);
        let of_twins = rate + (1.0 - rate) * RATE_OF_TWINS;
        let nats = match answer {
            PairAnswer::Agrees => libm::log((1.0 - rate) / (1.0 - of_twins)),
            PairAnswer::Contradicts => libm::log(rate / of_twins),
            PairAnswer::Silent => continue,
        };
        by_view[first].0 += nats;
        by_view[first].1 += 1.0;
    }
    by_view.iter().filter(|(_, n)| *n > 0.0).map(|(nats, n)| nats / n).sum()
}

/// By view: the rate at which it contradicts others of its own place.
fn rates(n_views: usize, own: &[AskedPair]) -> Vec<f64> {
    let mut by_view = vec![(0.0, 0.0); n_views];
    let (mut n_contradict, mut n_pairs) = (0.0, 0.0);
    for &((first, second), answer) in own.iter().filter(|(_, answer)| *answer != PairAnswer::Silent) {
        let contradicts = f64::from(u8::from(answer == PairAnswer::Contradicts));
        for view in [first, second] {
            by_view[view].0 += contradicts;
            by_view[view].1 += 1.0;
        }
        n_contradict += contradicts;
        n_pairs += 1.0;
    }
    let pooled = (n_contradict + 1.0) / (n_pairs + PRIOR_PAIRS);
    by_view.iter().map(|(c, n)| (c + POOLED_PAIRS * pooled) / (n + POOLED_PAIRS)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of neighbours among views of a part, of which each `nth` contradicts.
    fn pairs(views: std::ops::Range<usize>, to: usize, nth: usize) -> Vec<AskedPair> {
        let answer = |k: usize| match k % nth {
            0 => PairAnswer::Contradicts,
            _ => PairAnswer::Agrees,
        };
        views
            .flat_map(|view| (0..4).map(move |j| ((view, to + (view + j) % 20), answer(4 * view + j + 1))))
            .collect()
    }

    #[test]
    fn parts_that_contradict_each_other_as_often_as_themselves_are_one_place() {
        // Asked often, so that little is left of the prior.
        let own = |nth: usize| (0..8).flat_map(|_| pairs(0..20, 0, nth)).collect::<Vec<_>>();
        let (calm, wild) = (own(1000), own(6));
        let nats = |own: &[AskedPair], nth| one_place_nats(40, own, &pairs(0..20, 20, nth));
        assert!(nats(&calm, 1000) > 1.5, "{}", nats(&calm, 1000));
        assert!(nats(&calm, 8) < -4.6, "{}", nats(&calm, 8));
        assert!(nats(&wild, 6) > 0.0, "{}", nats(&wild, 6));
        assert!(nats(&wild, 2) < -2.0, "{}", nats(&wild, 2));
        let silent: Vec<AskedPair> =
            pairs(0..20, 20, 1).into_iter().map(|(pair, _)| (pair, PairAnswer::Silent)).collect();
        assert_eq!(one_place_nats(40, &calm, &silent), 0.0);
    }

    #[test]
    fn a_view_that_contradicts_its_own_part_says_nothing() {
        let mut own = pairs(0..20, 0, 1000);
        own.extend((0..20).map(|k| ((3, k), PairAnswer::Contradicts)));
        let across = |view: usize| (0..4).map(move |k| ((view, 20 + k), PairAnswer::Contradicts));
        let nats = |view| one_place_nats(40, &own, &across(view).collect::<Vec<_>>());
        assert!(nats(3) > -0.2 && nats(4) < -0.4, "{} {}", nats(3), nats(4));
    }
}
