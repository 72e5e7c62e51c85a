//! Association of estimates with ground truth: pairs of nearest time.

/// Pairs `(groundtruth, estimate)` of indices as `associate.py` makes them: greedy, the nearest
/// times first, each used once, differences strictly below `max_difference_s`.
///
/// Both lists are in seconds and sorted; `offset_s` is added to the estimate's times.
pub fn associate_tum(
    groundtruth_s: &[f64],
    estimate_s: &[f64],
    max_difference_s: f64,
    offset_s: f64,
) -> Vec<(usize, usize)> {
    let mut candidates = Vec::new();
    let mut first = 0;
    for (at_estimate, &estimate) in estimate_s.iter().enumerate() {
        let shifted = estimate + offset_s;
        // Twice the limit, so that rounding decides only in the comparison that the script makes.
        while first < groundtruth_s.len() && groundtruth_s[first] < shifted - 2.0 * max_difference_s {
            first += 1;
        }
        for (at_truth, &truth) in groundtruth_s.iter().enumerate().skip(first) {
            if truth > shifted + 2.0 * max_difference_s {
                break;
            }
            let difference = (truth - shifted).abs();
            if difference < max_difference_s {
                candidates.push((difference, at_truth, at_estimate));
            }
        }
    }
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)).then(a.2.cmp(&b.2)));
    let mut truth_free = vec![true; groundtruth_s.len()];
    let mut estimate_free = vec![true; estimate_s.len()];
    let mut pairs = Vec::new();
    for (_, at_truth, at_estimate) in candidates {
        if truth_free[at_truth] && estimate_free[at_estimate] {
            truth_free[at_truth] = false;
            estimate_free[at_estimate] = false;
            pairs.push((at_truth, at_estimate));
        }
    }
    pairs.sort_unstable();
    pairs
}

/// Pairs `(groundtruth, estimate)` of indices as evo makes them: for each pose of the shorter
/// trajectory the nearest of the longer one, if at most `max_difference_s` away. One pose of the
/// longer may be used twice.
pub fn associate_evo(
    groundtruth_s: &[f64],
    estimate_s: &[f64],
    max_difference_s: f64,
) -> Vec<(usize, usize)> {
    let estimate_is_longer = estimate_s.len() > groundtruth_s.len();
    let (short, long) =
        if estimate_is_longer { (groundtruth_s, estimate_s) } else { (estimate_s, groundtruth_s) };
    let mut pairs = Vec::new();
    for (at_short, &time) in short.iter().enumerate() {
        let Some(at_long) = nearest(long, time) else { continue };
        if (long[at_long] - time).abs() <= max_difference_s {
            pairs.push(if estimate_is_longer { (at_short, at_long) } else { (at_long, at_short) });
        }
    }
    pairs
}

/// Index of the nearest time, the earlier one of two equally near; `None` in an empty list.
fn nearest(sorted_s: &[f64], time_s: f64) -> Option<usize> {
    let after = sorted_s.partition_point(|&t| t < time_s);
    if after == sorted_s.len() {
        return after.checked_sub(1);
    }
    if after > 0 && (sorted_s[after - 1] - time_s).abs() <= (sorted_s[after] - time_s).abs() {
        return Some(after - 1);
    }
    Some(after)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn greedy_pairs_take_the_nearest_first_and_each_once() {
        // 0.010 is nearer to 0.012 than 0.000 is, so 0.000 gets nothing else in reach.
        assert_eq!(associate_tum(&[0.000, 0.010], &[0.012], 0.02, 0.0), [(1, 0)]);
        assert_eq!(associate_tum(&[0.0, 1.0], &[0.011, 0.012], 0.02, 0.0), [(0, 0)]);
        assert_eq!(associate_tum(&[0.0, 1.0], &[0.1, 1.1], 0.02, 0.0), []);
        assert_eq!(associate_tum(&[0.0, 1.0], &[0.1, 1.1], 0.02, -0.1), [(0, 0), (1, 1)]);
        assert_eq!(associate_tum(&[], &[0.1], 0.02, 0.0), []);
    }

    #[test]
    fn the_limit_itself_is_out_for_tum_and_in_for_evo() {
        assert_eq!(associate_tum(&[0.0], &[0.5], 0.5, 0.0), []);
        assert_eq!(associate_evo(&[0.0], &[0.5], 0.5), [(0, 0)]);
    }

    #[test]
    fn evo_may_use_a_pose_of_the_longer_twice() {
        assert_eq!(associate_evo(&[0.0, 5.0, 9.0], &[0.01, 0.011], 0.02), [(0, 0), (0, 1)]);
        assert_eq!(associate_evo(&[0.0, 0.001], &[0.0, 5.0, 9.0], 0.02), [(0, 0), (1, 0)]);
        assert_eq!(associate_evo(&[1.0, 3.0, 9.0], &[2.0], 2.0), [(0, 0)]);
    }
}
