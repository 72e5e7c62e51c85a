//! Order and times of recorded images: stamps that are not set, that go back, that repeat.
//!
//! The order of recording is the order of the frames. A clock that is set back, or a recording that
//! was played twice, begins a new stretch of time, which is counted on from the one before; stamps
//! that are not set are replaced by those of the other stream, or by the times of recording. Each of these is stated in a sentence.

mod borrowed;
mod stretches;

use borrowed::borrow;
use stretches::{Stretches, stretches};

/// Interval where nothing tells the rate, nanoseconds: 30 frames a second.
const USUAL_INTERVAL_NANOS: i64 = 33_333_333;

/// An image as it was recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedImage {
    /// Time by the sensor, nanoseconds.
    pub stamp_nanos: i64,
    /// Time of recording, nanoseconds, where the file has one.
    pub log_nanos: Option<i64>,
    /// Position in the recording, comparable between depth and colour.
    pub ordinal: u64,
}

/// The images of one stream in the order of their frames.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ImageOrder {
    /// For each frame its index among the recorded images.
    pub order: Vec<usize>,
    /// Time of each frame, nanoseconds, strictly increasing.
    pub stamps_nanos: Vec<i64>,
}

/// Depth and colour on one time axis.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Timelines {
    /// That of depth.
    pub depth: ImageOrder,
    /// That of colour.
    pub colour: ImageOrder,
    /// What was found wrong and how it was mended.
    pub sentences: Vec<String>,
    /// Whether the recording goes on in a new stretch of time.
    pub has_new_stretch: bool,
}

/// Orders two streams of one clock; `names` of depth and colour for the sentences.
pub fn timelines(depth: &[RecordedImage], colour: &[RecordedImage], names: [&str; 2]) -> Timelines {
    let mut all = Timelines::default();
    let (mut depth, mut colour) = (depth.to_vec(), colour.to_vec());
    for (stream, name) in [(&mut depth, names[0]), (&mut colour, names[1])] {
        all.sentences.extend(fill_some(stream, name));
    }
    let is_logged = has_log(&depth) && has_log(&colour);
    match [(&depth, names[0]), (&colour, names[1])].map(|(stream, name)| unusable(stream, name)) {
        [None, None] => {}
        [Some(fault), None] if colour.len() > 1 => {
            borrow(&mut depth, &colour, is_logged);
            all.sentences.push(format!("{fault}: the times of {} are used", names[1]));
        }
        [None, Some(fault)] if depth.len() > 1 => {
            borrow(&mut colour, &depth, is_logged);
            all.sentences.push(format!("{fault}: the times of {} are used", names[0]));
        }
        faults => {
            let instead =
                if is_logged { "the times of recording are used" } else { "30 frames a second are assumed" };
            let faults: Vec<String> = faults.into_iter().flatten().collect();
            all.sentences.push(format!("{}: {instead}", faults.join(", ")));
            by_recording(&mut depth, is_logged);
            by_recording(&mut colour, is_logged);
        }
    }
    let of_depth = stretches(&depth, names[0]);
    let of_colour = stretches(&colour, names[1]);
    all.sentences.extend(of_depth.sentences.iter().cloned());
    if of_depth.n() == 1 {
        // Those of depth state it already.
        all.sentences.extend(of_colour.sentences.iter().cloned());
    }
    all.has_new_stretch = of_depth.n() > 1;
    let shifts = shifts(&depth, &of_depth);
    all.depth = shifted(&depth, &of_depth, &shifts);
    let of_stretch = partners(&colour, &of_colour, &depth, &of_depth);
    let colour_shifts: Vec<i64> = of_stretch.iter().map(|at| shifts.get(*at).copied().unwrap_or(0)).collect();
    all.colour = shifted(&colour, &of_colour, &colour_shifts);
    all
}

/// Median interval between stamps that rise, nanoseconds.
fn interval_nanos(stream: &[RecordedImage]) -> i64 {
    let mut steps: Vec<i64> = stream
        .iter()
        .zip(stream.iter().skip(1))
        .map(|(before, after)| after.stamp_nanos.saturating_sub(before.stamp_nanos))
        .filter(|step| *step > 0)
        .collect();
    steps.sort_unstable();
    steps.get(steps.len() / 2).copied().unwrap_or(USUAL_INTERVAL_NANOS)
}

/// From each number to the next.
fn steps_of(nanos: &[i64]) -> impl Iterator<Item = i64> + '_ {
    nanos.iter().zip(nanos.iter().skip(1)).map(|(before, after)| after.saturating_sub(*before))
}

/// A pause that is stated: seconds, and times the median interval.
const LONG_PAUSE_NANOS: i64 = 60_000_000_000;
const LONG_PAUSE_INTERVALS: i64 = 100;

/// A sentence on the longest pause between frames, where it is so long that a stamp may be wrong.
pub fn long_pause(stamps_nanos: &[i64]) -> Option<String> {
    let steps = || steps_of(stamps_nanos);
    let mut sorted: Vec<i64> = steps().collect();
    sorted.sort_unstable();
    let limit = LONG_PAUSE_NANOS.max(LONG_PAUSE_INTERVALS.saturating_mul(*sorted.get(sorted.len() / 2)?));
    let (at, longest) = steps().enumerate().max_by_key(|(_, step)| *step)?;
    (longest > limit).then(|| {
        format!(
            "{:.0} s pass between frames {at} and {}, far more than between the others",
            longest as f64 * 1e-9,
            at.saturating_add(1)
        )
    })
}

/// Whether the times of recording can order the frames.
fn has_log(stream: &[RecordedImage]) -> bool {
    let logs: Vec<i64> = stream.iter().filter_map(|image| image.log_nanos).collect();
    let n_rising = steps_of(&logs).filter(|step| *step > 0).count();
    let n_steps = stream.len().saturating_sub(1);
    logs.len() == stream.len() && n_rising.saturating_mul(10) >= n_steps.saturating_mul(9)
}

/// Stamps that are zero here and there: from the time of recording, or from the stamp before.
fn fill_some(stream: &mut [RecordedImage], name: &str) -> Option<String> {
    let is_unset = |image: &RecordedImage| image.stamp_nanos == 0;
    let n_unset = stream.iter().filter(|image| is_unset(image)).count();
    // One that counts from zero begins so.
    let is_start = n_unset == 1 && stream.first().is_some_and(is_unset) && !is_far(stream);
    if n_unset == 0 || is_start || n_unset.saturating_mul(2) > stream.len() {
        return None;
    }
    let interval = interval_nanos(stream);
    let mut offsets: Vec<i64> = stream
        .iter()
        .filter(|image| !is_unset(image))
        .filter_map(|image| Some(image.stamp_nanos.saturating_sub(image.log_nanos?)))
        .collect();
    offsets.sort_unstable();
    let offset = offsets.get(offsets.len() / 2).copied();
    let first = stream.iter().position(|image| !is_unset(image)).unwrap_or(0);
    let n_before = (first as i64).saturating_add(1);
    let first_nanos = stream.get(first).map_or(0, |image| image.stamp_nanos);
    let mut before = first_nanos.saturating_sub(interval.saturating_mul(n_before));
    for image in stream.iter_mut() {
        if image.stamp_nanos == 0 {
            let by_log = offset.zip(image.log_nanos).map(|(offset, log)| log.saturating_add(offset));
            image.stamp_nanos = by_log.unwrap_or(before.saturating_add(interval));
        }
        before = image.stamp_nanos;
    }
    Some(format!("{name}: {n_unset} of {} stamps are not set and were filled in", stream.len()))
}

/// Whether the second stamp is far from zero, so that a first one of zero is not set.
fn is_far(stream: &[RecordedImage]) -> bool {
    stream.get(1).is_some_and(|image| image.stamp_nanos > interval_nanos(stream).saturating_mul(100))
}

/// Why stamps cannot tell the time of the images; `None`: they can.
fn unusable(stream: &[RecordedImage], name: &str) -> Option<String> {
    let n = stream.len();
    if n < 2 {
        return None;
    }
    let n_unset = stream.iter().filter(|image| image.stamp_nanos == 0).count();
    if n_unset.saturating_mul(2) > n {
        return Some(format!("{name}: {n_unset} of {n} stamps are not set"));
    }
    let stamps = stream.iter().map(|image| image.stamp_nanos);
    let n_same = stamps.clone().zip(stamps.skip(1)).filter(|(before, after)| before == after).count();
    (n_same.saturating_mul(4) > n)
        .then(|| format!("{name}: {n_same} of {n} stamps are equal to the one before"))
}

/// Stamps by the times of recording, or at the usual rate.
fn by_recording(stream: &mut [RecordedImage], is_logged: bool) {
    let mut last = i64::MIN;
    for (at, image) in (0_i64..).zip(stream.iter_mut()) {
        image.stamp_nanos = match image.log_nanos.filter(|_| is_logged) {
            // Written in one breath: in order all the same.
            Some(log) => log.max(last.saturating_add(1)),
            None => at.saturating_mul(USUAL_INTERVAL_NANOS),
        };
        last = image.stamp_nanos;
    }
}

/// What is added to the stamps of each stretch, so that it goes on from the one before.
fn shifts(stream: &[RecordedImage], found: &Stretches) -> Vec<i64> {
    let interval = interval_nanos(stream);
    let mut shifts: Vec<i64> = Vec::new();
    let mut end: Option<(i64, Option<i64>)> = None;
    for members in &found.members {
        let ends = members.first().zip(members.last());
        let Some((first, last)) = ends.and_then(|(first, last)| stream.get(*first).zip(stream.get(*last)))
        else {
            shifts.push(0);
            continue;
        };
        let shift = end.map_or(0, |(last_nanos, last_log)| {
            let logged = first.log_nanos.zip(last_log).map(|(now, before)| now.saturating_sub(before));
            let pause = logged.filter(|pause| (interval / 2..interval.saturating_mul(300)).contains(pause));
            last_nanos.saturating_add(pause.unwrap_or(interval)).saturating_sub(first.stamp_nanos)
        });
        shifts.push(shift);
        end = Some((last.stamp_nanos.saturating_add(shift), last.log_nanos));
    }
    shifts
}

/// All members with their shifted stamps; one that does not rise is left out.
fn shifted(stream: &[RecordedImage], found: &Stretches, shifts: &[i64]) -> ImageOrder {
    let mut rows: Vec<(i64, usize)> = Vec::new();
    for (members, shift) in found.members.iter().zip(shifts) {
        let row = |at: &usize| Some((stream.get(*at)?.stamp_nanos.saturating_add(*shift), *at));
        rows.extend(members.iter().filter_map(row));
    }
    rows.sort_by_key(|(stamp, _)| *stamp);
    rows.dedup_by_key(|(stamp, _)| *stamp);
    let (stamps_nanos, order) = rows.into_iter().unzip();
    ImageOrder { order, stamps_nanos }
}

/// For each stretch of colour that of depth: one to one, or by the place in the recording.
fn partners(
    colour: &[RecordedImage],
    of_colour: &Stretches,
    depth: &[RecordedImage],
    of_depth: &Stretches,
) -> Vec<usize> {
    if of_colour.n() == of_depth.n() {
        return (0..of_colour.n()).collect();
    }
    let ordinal = |stream: &[RecordedImage], at: Option<&usize>| {
        at.and_then(|at| stream.get(*at)).map_or(0, |image| image.ordinal)
    };
    let begins: Vec<u64> = of_depth.members.iter().map(|members| ordinal(depth, members.first())).collect();
    let stretch_at = |ordinal: u64| begins.iter().rposition(|begin| *begin <= ordinal).unwrap_or(0);
    let middle = |members: &Vec<usize>| ordinal(colour, members.get(members.len() / 2));
    of_colour.members.iter().map(|members| stretch_at(middle(members))).collect()
}

#[cfg(test)]
mod tests;
