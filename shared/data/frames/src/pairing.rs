//! Pairing of colour images with depth images.

use crate::Pairing;
use crate::colour_offset::ColourOffset;

/// Depth images with the colour images taken with them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PairedImages {
    /// Index of the colour image, for each depth image.
    pub partners: Vec<Option<usize>>,
    /// When each depth image was taken, nanoseconds; times rise.
    pub taken_nanos: Vec<i64>,
}

/// Pairs one to one in the order of time; each is the other's nearest by the running offset. Images whose offset
/// changes by more than jitter were not taken together, and tell nothing of when that was. Times rise.
pub fn pair(depth_nanos: &[i64], colour_nanos: &[i64]) -> PairedImages {
    let (mut offset, mut pairs, mut spread) = (ColourOffset::default(), PairedImages::default(), Vec::new());
    // First colour image that is not taken or passed over.
    let mut first = 0;
    for (at, &stamp) in depth_nanos.iter().enumerate() {
        let distance = |from: i64, to: i64| offset.distance_nanos(to.saturating_sub(from));
        let mut nearest: Option<(i64, usize)> = None;
        for (place, &colour) in colour_nanos.iter().enumerate().skip(first) {
            match distance(stamp, colour) {
                Some(found) if nearest.is_none_or(|(least, _)| found < least) => {
                    nearest = Some((found, place))
                }
                None if colour < stamp => first = place.saturating_add(1),
                _ => break,
            }
        }
        let next = depth_nanos.get(at.saturating_add(1));
        let is_of_next = |colour: i64, found: i64| {
            next.and_then(|next| distance(*next, colour)).is_some_and(|of_next| of_next < found)
        };
        let partner = nearest.and_then(|(found, place)| Some((found, place, *colour_nanos.get(place)?)));
        let partner = partner.filter(|(found, _, colour)| !is_of_next(*colour, *found));
        if let Some((_, place, colour)) = partner {
            let difference = colour.saturating_sub(stamp);
            offset.add(difference);
            spread.push(offset.deviation_nanos(difference));
            first = place.saturating_add(1);
        }
        pairs.partners.push(partner.map(|(_, place, _)| place));
        let after = pairs.taken_nanos.last().map_or(i64::MIN, |last| last.saturating_add(1));
        pairs.taken_nanos.push(offset.taken_nanos(stamp).max(after));
    }
    spread.sort_unstable();
    if spread.get(spread.len() / 2).is_some_and(|middle| *middle > ColourOffset::MOST_JITTER_NANOS) {
        pairs.taken_nanos = depth_nanos.to_vec();
    }
    pairs
}

impl PairedImages {
    /// Keeps the first depth images.
    pub fn truncate(&mut self, n_depth: usize) {
        self.partners.truncate(n_depth);
        self.taken_nanos.truncate(n_depth);
    }

    /// What came of pairing.
    pub fn summarise(&self, depth_nanos: &[i64], colour_nanos: &[i64]) -> Pairing {
        let differences = depth_nanos.iter().zip(&self.partners).filter_map(|(stamp, partner)| {
            Some(colour_nanos.get((*partner)?)?.saturating_sub(*stamp).saturating_abs())
        });
        let taken = depth_nanos.iter().zip(&self.taken_nanos);
        let mut after: Vec<i64> = taken.map(|(stamp, taken)| taken.saturating_sub(*stamp)).collect();
        after.sort_unstable();
        Pairing {
            n_depth: depth_nanos.len(),
            n_colour: colour_nanos.len(),
            n_pairs: self.partners.iter().flatten().count(),
            largest_difference_nanos: differences.max().unwrap_or(0),
            taken_after_nanos: after.get(after.len() / 2).map_or(0, |after| (*after).min(0)),
        }
    }
}

/// Share of frames without colour from which on it is stated.
const MOST_UNCOLOURED: f64 = 0.5;

/// Share of the frames that may be without colour one behind the other, and frames that always may.
const MOST_IN_A_ROW: (f64, usize) = (0.1, 5);

/// A sentence on the longest stretch without colour, as a list that was cut leaves it.
fn stretch_without(partners: &[Option<usize>]) -> Option<String> {
    let with: Vec<usize> =
        (0..partners.len()).filter(|at| matches!(partners.get(*at), Some(Some(_)))).collect();
    let begins = std::iter::once(0).chain(with.iter().map(|at| at.saturating_add(1)));
    let ends = with.iter().copied().chain([partners.len()]);
    let (begin, end) = begins.zip(ends).max_by_key(|(begin, end)| end.saturating_sub(*begin))?;
    let n = end.saturating_sub(begin);
    let is_long = n > MOST_IN_A_ROW.1 && n as f64 > MOST_IN_A_ROW.0 * partners.len() as f64;
    is_long.then(|| {
        let last = end.saturating_sub(1);
        format!(
            "frames {begin} to {last} of {} have no colour: no colour image is near them in time",
            partners.len()
        )
    })
}

/// A sentence on frames without colour where there are many, or none has any; `reason`: why there are
/// no colour images.
pub fn uncoloured(
    depth_nanos: &[i64],
    colour_nanos: &[i64],
    partners: &[Option<usize>],
    reason: Option<&str>,
) -> Option<String> {
    let (n, n_without) = (partners.len(), partners.iter().filter(|partner| partner.is_none()).count());
    if n == 0 || (n_without as f64) <= MOST_UNCOLOURED * n as f64 {
        return stretch_without(partners);
    }
    let who = if n_without == n {
        "no frame has colour".to_owned()
    } else {
        format!("{n_without} of {n} frames have no colour")
    };
    let [earliest_s, latest_s] = ColourOffset::WITHIN_NANOS.map(|nanos| nanos.unsigned_abs() as f64 * 1e-9);
    let why = match (reason, offset_nanos(depth_nanos, colour_nanos)) {
        (Some(reason), _) => reason.to_owned(),
        (None, Some(offset)) => format!(
            "the colour image nearest to a depth image is {:.3} s {}, expected at most {latest_s} s later or {earliest_s} s earlier; do their clocks differ?",
            offset.unsigned_abs() as f64 * 1e-9,
            if offset > 0 { "later" } else { "earlier" }
        ),
        (None, None) => "there are no colour images".to_owned(),
    };
    Some(format!("{who}: {why}"))
}

/// Median time from a depth image without a partner to its nearest colour image, nanoseconds.
fn offset_nanos(depth_nanos: &[i64], colour_nanos: &[i64]) -> Option<i64> {
    if let ([first, .., last], [colour_first, .., colour_last]) = (depth_nanos, colour_nanos)
        && (colour_first > last || colour_last < first)
    {
        // Two clocks.
        return Some(colour_first.saturating_sub(*first));
    }
    let nearest = |stamp: &i64| {
        let after = colour_nanos.partition_point(|other| other < stamp);
        let near = [after.checked_sub(1), Some(after)].into_iter().flatten();
        let differences = near.filter_map(|at| Some(colour_nanos.get(at)?.saturating_sub(*stamp)));
        differences.min_by_key(|difference| difference.saturating_abs())
    };
    let mut offsets: Vec<i64> = depth_nanos.iter().filter_map(nearest).collect();
    offsets.retain(|offset| ColourOffset::default().distance_nanos(*offset).is_none());
    offsets.sort_unstable();
    offsets.get(offsets.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MILLI: i64 = 1_000_000;

    /// Depth images at 30 Hz, stamped up to 2.5 ms later than evenly, and colour images whose stamps are a phase later.
    fn streams(n: i64, phase_millis: impl Fn(i64) -> i64) -> (Vec<i64>, Vec<i64>) {
        let even = |k: i64| k * 1_000_000_000 / 30;
        let depth = (2..n).map(|k| even(k) + k * 7 % 6 * MILLI / 2).collect();
        (depth, (0..n).map(|k| even(k) + phase_millis(k) * MILLI).collect())
    }

    fn steps(pairs: &PairedImages) -> Vec<usize> {
        let partners: Vec<usize> = pairs.partners.iter().flatten().copied().collect();
        partners.windows(2).map(|pair| pair[1] - pair[0]).collect()
    }

    #[test]
    fn colour_half_a_frame_away_is_always_that_of_the_same_side() {
        for phase in 14..20 {
            let (depth, colour) = streams(300, |_| phase);
            let pairs = pair(&depth, &colour);
            assert!(pairs.partners.iter().all(Option::is_some));
            assert!(steps(&pairs).iter().all(|step| *step == 1), "phase of {phase} ms");
            let after = pairs.summarise(&depth, &colour).taken_after_nanos / MILLI;
            assert!((phase - 36..=phase - 33).contains(&after), "{phase} ms: {after}");
        }
    }

    #[test]
    fn streams_whose_phase_changes_slowly_change_sides_once_a_frame() {
        let (depth, colour) = streams(1200, |k| k / 10);
        let pairs = pair(&depth, &colour);
        // Colour images drift away by 120 ms: three to four frames have none.
        assert!(steps(&pairs).iter().all(|step| *step == 1));
        let n_without = pairs.partners.iter().filter(|partner| partner.is_none()).count();
        assert!((3..=4).contains(&n_without), "{n_without}");
        assert!(pairs.taken_nanos.is_sorted_by(|a, b| a < b));
    }

    #[test]
    fn stamps_of_one_time_stay_and_depth_is_never_taken_after_its_stamp() {
        for later in [0, 4 * MILLI] {
            let (depth, _) = streams(100, |_| 0);
            let colour: Vec<i64> = depth.iter().map(|stamp| stamp + later).collect();
            let pairs = pair(&depth, &colour);
            assert_eq!(pairs.taken_nanos, depth);
            assert_eq!(pairs.summarise(&depth, &colour).stamp_sigma_s(), 0.0);
        }
    }

    #[test]
    fn streams_without_a_common_phase_do_not_tell_when_depth_was_taken() {
        let depth: Vec<i64> = (0..50).map(|k| (40 + k * 207) * MILLI).collect();
        let colour: Vec<i64> = (0..400).map(|k| k * 1_000_000_000 / 30).collect();
        let pairs = pair(&depth, &colour);
        assert!(pairs.partners.iter().all(Option::is_some));
        assert_eq!(pairs.taken_nanos, depth);
    }

    #[test]
    fn a_frame_without_colour_is_moved_as_its_neighbours() {
        let (depth, mut colour) = streams(100, |_| -12);
        let whole = pair(&depth, &colour);
        colour.remove(50);
        let pairs = pair(&depth, &colour);
        let missing = pairs.partners.iter().position(Option::is_none).unwrap();
        assert!((pairs.taken_nanos[missing] - whole.taken_nanos[missing]).abs() < MILLI);
        assert!(depth[missing] - pairs.taken_nanos[missing] > 10 * MILLI);
    }

    #[test]
    fn pairs_are_nearest_one_to_one_below_the_limit() {
        let nanos = |millis: &[i64]| -> Vec<i64> { millis.iter().map(|&t| t * 1_000_000).collect() };
        let check = |depth: &[i64], colour: &[i64], expected: &[Option<usize>]| {
            assert_eq!(pair(&nanos(depth), &nanos(colour)).partners, expected);
        };
        check(&[0, 33, 66], &[1, 30, 67], &[Some(0), Some(1), Some(2)]);
        check(&[0, 10], &[9], &[None, Some(0)]);
        check(&[0], &[20], &[None]);
        check(&[0], &[-19], &[Some(0)]);
        check(&[0, 100, 200], &[205], &[None, None, Some(0)]);
    }

    #[test]
    fn frames_without_colour_are_stated_with_the_reason() {
        const SECOND: i64 = 1_000_000_000;
        let depth: Vec<i64> = (0..10).map(|k| k * SECOND / 30).collect();
        let sentence =
            |colour: &[i64], reason| uncoloured(&depth, colour, &pair(&depth, colour).partners, reason);
        assert_eq!(sentence(&depth, None), None);
        let late: Vec<i64> = depth.iter().map(|stamp| stamp + 5 * SECOND).collect();
        let words = sentence(&late, None).unwrap();
        assert!(words.contains("no frame has colour") && words.contains("5.000 s later"), "{words}");
        let words = sentence(&depth[..3], None).unwrap();
        assert!(words.contains("7 of 10 frames have no colour") && words.contains("earlier"), "{words}");
        assert_eq!(sentence(&depth[..5], None), None, "half of the rate");
        assert_eq!(sentence(&[], None).unwrap(), "no frame has colour: there are no colour images");
        assert_eq!(sentence(&[], Some("it is a video")).unwrap(), "no frame has colour: it is a video");
    }

    #[test]
    fn a_long_stretch_without_colour_is_stated() {
        let words = |n_with: usize, n: usize| {
            let partners: Vec<_> = (0..n).map(|k| (k < n_with).then_some(k)).collect();
            let stamps: Vec<i64> = (0..n as i64).map(|k| k * 33_000_000).collect();
            uncoloured(&stamps, &stamps[..n_with], &partners, None)
        };
        assert!(words(13, 24).unwrap().starts_with("frames 13 to 23 of 24 have no colour: no colour image"));
        assert_eq!((words(24, 24), words(20, 24), words(190, 200)), (None, None, None));
        // Colour at half the rate.
        let half: Vec<_> = (0..100).map(|k| (k % 2 == 0).then_some(k / 2)).collect();
        assert_eq!(uncoloured(&[0; 100], &[0; 50], &half, None), None);
    }
}
