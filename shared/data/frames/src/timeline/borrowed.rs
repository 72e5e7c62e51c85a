//! Times of a stream whose own stamps cannot be used, by those of the other stream.

use super::RecordedImage;

/// Gives each image the time of its place in the recording, between the images of `other`: by the times of
/// recording, or by the order where there are none.
pub(super) fn borrow(stream: &mut [RecordedImage], other: &[RecordedImage], is_logged: bool) {
    let key = |image: &RecordedImage| match image.log_nanos.filter(|_| is_logged) {
        Some(log) => i128::from(log),
        None => i128::from(image.ordinal),
    };
    let mut places: Vec<(i128, i64)> = other.iter().map(|image| (key(image), image.stamp_nanos)).collect();
    places.sort_by_key(|(place, _)| *place);
    places.dedup_by_key(|(place, _)| *place);
    let last_step = places.iter().rev().zip(places.iter().rev().skip(1)).next();
    let last_step = last_step.map(|(last, before)| (last.0.saturating_sub(before.0), step(before.1, last.1)));
    let mut newest = None;
    for image in stream {
        let place = key(image);
        let behind = places.partition_point(|(other, _)| *other <= place);
        let (from, to) = (places.get(behind.saturating_sub(1)), places.get(behind));
        let Some(&(begin, stamp)) = from else { return };
        let (keys, nanos) = match to.filter(|_| behind > 0) {
            Some(next) => (next.0.saturating_sub(begin), step(stamp, next.1)),
            // Before the first and behind the last, at the pace of the last step.
            None => last_step.unwrap_or((1, 0)),
        };
        let off = place.saturating_sub(begin).saturating_mul(i128::from(nanos));
        let off = off.checked_div(keys).unwrap_or(0);
        let time = i64::try_from(i128::from(stamp).saturating_add(off)).unwrap_or(stamp);
        // Two at one place keep their order.
        let is_repeated = newest.is_some_and(|(before, newest)| before == place && newest >= time);
        image.stamp_nanos = if is_repeated { time.saturating_add(1) } else { time };
        newest = Some((place, image.stamp_nanos));
    }
}

/// From a stamp to the next; nothing where the clock was set back between them.
fn step(before: i64, after: i64) -> i64 {
    after.saturating_sub(before).max(0)
}
