//! Stretches of time in a stream: where the clock was set, images that came late, and repeats.
#![expect(clippy::indexing_slicing, reason = "members are indices of the stream that they were made from")]

use super::{RecordedImage, interval_nanos};

/// Messages in a row that may come late, after one that is newer.
const MOST_LATE: usize = 2;
/// Share of intervals that go back, above which the order of the file is no order of time.
const UNORDERED_SHARE: f64 = 0.1;
/// Backward steps that are always believed to be a clock that was set.
const FEW_BACK: usize = 3;
/// A step forward that may be a clock that was set: seconds and intervals.
const LONG_STEP_NANOS: i64 = 1_000_000_000;
const LONG_STEP_INTERVALS: i64 = 10;

/// Members of each stretch, in the order of their stamps.
pub(super) struct Stretches {
    pub(super) members: Vec<Vec<usize>>,
    pub(super) sentences: Vec<String>,
}

impl Stretches {
    pub(super) fn n(&self) -> usize {
        self.members.len()
    }
}

/// Finds the stretches of a stream that is in the order of recording.
pub(super) fn stretches(stream: &[RecordedImage], name: &str) -> Stretches {
    let interval = interval_nanos(stream);
    let mut walk = StretchWalk { stream, interval, members: vec![Vec::new()], ..StretchWalk::default() };
    let mut sentences = Vec::new();
    for at in 0..stream.len() {
        if let Some(sentence) = walk.take(at, name) {
            sentences.push(sentence);
        }
    }
    let n_back = walk.members.len().saturating_sub(1);
    if n_back > FEW_BACK && n_back as f64 > UNORDERED_SHARE * stream.len() as f64 {
        let mut members: Vec<usize> = (0..stream.len()).collect();
        members.sort_by_key(|at| stream[*at].stamp_nanos);
        members.dedup_by_key(|at| stream[*at].stamp_nanos);
        let n_left_out = stream.len().saturating_sub(members.len());
        let mut sentence =
            format!("{name}: {n_back} of {} stamps are below the one before: sorted by time", stream.len());
        if n_left_out > 0 {
            sentence.push_str(&format!(", {n_left_out} that repeat a time are left out"));
        }
        return Stretches { members: vec![members], sentences: vec![sentence] };
    }
    const MOST_NAMED: usize = 3;
    if sentences.len() > MOST_NAMED {
        let n_more = sentences.len().saturating_sub(MOST_NAMED);
        sentences.truncate(MOST_NAMED);
        sentences.push(format!("{name}: {n_more} further times the clock was set"));
    }
    if walk.n_repeated > 0 {
        sentences.push(format!("{name}: {} messages repeat a time and are left out", walk.n_repeated));
    }
    if walk.n_late > 0 {
        sentences.push(format!(
            "{name}: {} images came late and were put in the order of their stamps",
            walk.n_late
        ));
    }
    Stretches { members: walk.members, sentences }
}

/// Goes through a stream.
#[derive(Default)]
struct StretchWalk<'a> {
    stream: &'a [RecordedImage],
    interval: i64,
    members: Vec<Vec<usize>>,
    n_repeated: usize,
    n_late: usize,
}

impl StretchWalk<'_> {
    /// Takes the next image; a sentence where the clock was set.
    fn take(&mut self, at: usize, name: &str) -> Option<String> {
        let stream = self.stream;
        let stamp = stream[at].stamp_nanos;
        let n_older =
            |newest: i64| stream[at..].iter().take_while(|image| image.stamp_nanos <= newest).count();
        let stretch = self.members.last_mut()?;
        let Some(&last) = stretch.last() else {
            stretch.push(at);
            return None;
        };
        let newest = stream[last].stamp_nanos;
        if stamp > newest {
            let step = stamp.saturating_sub(newest);
            let logged = stream[at].log_nanos.zip(stream[last].log_nanos);
            let logged = logged.map(|(now, before)| now.saturating_sub(before)).filter(|step| *step > 0);
            let is_long = step > LONG_STEP_NANOS.max(LONG_STEP_INTERVALS.saturating_mul(self.interval));
            if is_long && logged.is_some_and(|logged| logged < step / 2) {
                self.members.push(vec![at]);
                let by = step as f64 * 1e-9;
                return Some(format!(
                    "{name}: the stamps jump ahead by {by:.3} s at image {}, the times of recording do not (a clock that was set): a new stretch of time begins there",
                    at.saturating_add(1)
                ));
            }
            stretch.push(at);
            return None;
        }
        // Among the newest, where has it its place?
        let place = stretch.iter().rposition(|member| stream[*member].stamp_nanos <= stamp);
        if let Some(place) = place {
            if stamp == newest && at.checked_sub(1).is_some_and(|before| stream[before].stamp_nanos == stamp)
            {
                self.n_repeated = self.n_repeated.saturating_add(1);
                return None;
            }
            let before = stream[stretch[place]].stamp_nanos;
            let behind = place.saturating_add(1);
            let after = stretch.get(behind).map_or(newest, |member| stream[*member].stamp_nanos);
            let is_hole = after.saturating_sub(before).saturating_mul(2) >= self.interval.saturating_mul(3);
            // Only few images in a row are older than what came before them.
            if before < stamp && is_hole && n_older(newest) <= MOST_LATE {
                stretch.insert(behind, at);
                self.n_late = self.n_late.saturating_add(1);
                return None;
            }
        }
        self.members.push(vec![at]);
        let by = newest.saturating_sub(stamp) as f64 * 1e-9;
        Some(format!(
            "{name}: the stamps go back by {by:.3} s at image {} (a clock that was set, or a recording that was repeated): a new stretch of time begins there",
            at.saturating_add(1)
        ))
    }
}
