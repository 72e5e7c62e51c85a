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
        let earliest = stamp.saturating_sub(MAX_DIFFERENCE_NANOS);
        while colour_nanos.get(first).is_some_and(|other| *other <= earliest) {
            first = usize::saturating_add(first, 1);
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
        let (Some(partner), Some(is_taken)) = (partners.get_mut(at_depth), taken.get_mut(at_colour)) else {
            continue;
        };
        if partner.is_none() && !*is_taken {
            *partner = Some(at_colour);
            *is_taken = true;
        }
    }
    partners
}

/// What came of pairing.
pub fn summarise(depth_nanos: &[i64], colour_nanos: &[i64], partners: &[Option<usize>]) -> Pairing {
    let differences = depth_nanos.iter().zip(partners).filter_map(|(stamp, partner)| {
        Some(colour_nanos.get((*partner)?)?.saturating_sub(*stamp).saturating_abs())
    });
    Pairing {
        n_depth: depth_nanos.len(),
        n_colour: colour_nanos.len(),
        n_pairs: partners.iter().flatten().count(),
        largest_difference_nanos: differences.max().unwrap_or(0),
    }
}

/// Share of frames without colour from which on it is stated.
const MOST_UNCOLOURED: f64 = 0.5;

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
        return None;
    }
    let who = if n_without == n {
        "no frame has colour".to_owned()
    } else {
        format!("{n_without} of {n} frames have no colour")
    };
    let limit_s = MAX_DIFFERENCE_NANOS as f64 * 1e-9;
    let why = match (reason, offset_nanos(depth_nanos, colour_nanos)) {
        (Some(reason), _) => reason.to_owned(),
        (None, Some(offset)) => format!(
            "the colour image nearest to a depth image is {:.3} s {}, expected at most {limit_s} s; do their clocks differ?",
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
    offsets.retain(|offset| offset.saturating_abs() >= MAX_DIFFERENCE_NANOS);
    offsets.sort_unstable();
    offsets.get(offsets.len() / 2).copied()
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

    #[test]
    fn frames_without_colour_are_stated_with_the_reason() {
        const SECOND: i64 = 1_000_000_000;
        let depth: Vec<i64> = (0..10).map(|k| k * SECOND / 30).collect();
        let sentence = |colour: &[i64], reason| uncoloured(&depth, colour, &pair(&depth, colour), reason);
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
}
