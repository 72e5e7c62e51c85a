//! Pairing of colour images with depth images.

use crate::Pairing;

/// Depth and colour belong together when their times differ by less than this.
const MAX_DIFFERENCE_NANOS: i64 = 20_000_000;

/// For each depth image the index of its colour image: greedy, the nearest times first, one to
/// one, differences below the limit, as `associate.py` of the TUM tools does it. Times rise.
pub fn pair(depth_nanos: &[i64], colour_nanos: &[i64]) -> Vec<Option<usize>> {
    let mut candidates = Vec::new();
    let mut first = 0;
    for (at_depth, &stamp) in depth_nanos.iter().enumerate() {
        while first < colour_nanos.len() && colour_nanos[first] <= stamp.saturating_sub(MAX_DIFFERENCE_NANOS)
        {
            first += 1;
        }
        for (at_colour, &other) in colour_nanos.iter().enumerate().skip(first) {
            let difference = other.saturating_sub(stamp);
            if difference >= MAX_DIFFERENCE_NANOS {
                break;
            }
            candidates.push((difference.saturating_abs(), at_depth, at_colour));
        }
    }
    candidates.sort_unstable();
    let mut partners = vec![None; depth_nanos.len()];
    let mut taken = vec![false; colour_nanos.len()];
    for (_, at_depth, at_colour) in candidates {
        if partners[at_depth].is_none() && !taken[at_colour] {
            partners[at_depth] = Some(at_colour);
            taken[at_colour] = true;
        }
    }
    partners
}

/// What came of pairing.
pub fn summarise(depth_nanos: &[i64], colour_nanos: &[i64], partners: &[Option<usize>]) -> Pairing {
    let differences = depth_nanos.iter().zip(partners).filter_map(|(stamp, partner)| {
        partner.map(|at| colour_nanos[at].saturating_sub(*stamp).saturating_abs())
    });
    Pairing {
        n_depth: depth_nanos.len(),
        n_colour: colour_nanos.len(),
        n_pairs: partners.iter().flatten().count(),
        largest_difference_nanos: differences.max().unwrap_or(0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_nearest_first_one_to_one_below_the_limit() {
        let nanos = |millis: &[i64]| -> Vec<i64> { millis.iter().map(|&t| t * 1_000_000).collect() };
        let check = |depth: &[i64], colour: &[i64], expected: &[Option<usize>]| {
            assert_eq!(pair(&nanos(depth), &nanos(colour)), expected);
        };
        check(&[0, 33, 66], &[1, 30, 67], &[Some(0), Some(1), Some(2)]);
        check(&[0, 10], &[9], &[None, Some(0)]);
        check(&[0], &[20], &[None]);
        check(&[0], &[-19], &[Some(0)]);
        check(&[0, 100, 200], &[205], &[None, None, Some(0)]);
    }
}
