//! What a count in a name counts: frames, or parts of a second.

/// Parts of a second, nanoseconds each, and their names.
pub(super) const SECOND: u64 = 1_000_000_000;
const UNITS: [(u64, &str); 4] =
    [(SECOND, "seconds"), (1_000_000, "milliseconds"), (1000, "microseconds"), (1, "nanoseconds")];
/// Seconds since 1970 of recordings: from the year 2001 to 2106.
const SINCE_1970_S: std::ops::Range<u64> = 1_000_000_000..4_294_967_296;
/// Step of frame numbers: every tenth image of a sequence is common.
pub(in crate::folder) const MOST_FRAME_STEP: u64 = 10;
/// Step of frame numbers that is the same all along.
const MOST_EVEN_STEP: u64 = 1000;
/// Intervals of a camera, nanoseconds.
const POSSIBLE_INTERVAL: std::ops::RangeInclusive<u64> = 4_000_000..=2_000_000_000;
/// Share of a step by which it may differ from the median where the clock is rounded.
const ROUNDING: f64 = 0.1;
/// Share of steps that must be so.
const MOST_STEPS: f64 = 0.8;

/// What numbers count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::folder) enum NameClock {
    /// Frames.
    Frames,
    /// Parts of a second of so many nanoseconds.
    Time(u64),
}

impl NameClock {
    /// Recognises what some numbers count, with its name for people.
    ///
    /// # Errors
    /// They may be both, or do not fit 64 bits of nanoseconds.
    pub(in crate::folder) fn of(values: &[u64]) -> Result<(Self, &'static str), String> {
        let mut sorted = values.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        let Some(&largest) = sorted.last() else { return Ok((Self::Frames, "frames")) };
        for (unit, name) in UNITS {
            let since = since_1970(unit);
            if sorted.iter().all(|value| since.contains(value)) {
                return Ok((Self::Time(unit), name));
            }
        }
        let pairs = sorted.iter().zip(sorted.iter().skip(1));
        let mut steps: Vec<u64> = pairs.map(|(before, after)| after.saturating_sub(*before)).collect();
        steps.sort_unstable();
        let ([shortest, ..], Some(&median), [smallest, ..]) =
            (&steps[..], steps.get(steps.len() / 2), &sorted[..])
        else {
            return Ok((Self::Frames, "frames"));
        };
        let share = |is: &dyn Fn(u64) -> bool| {
            steps.iter().filter(|step| is(**step)).count() as f64 / steps.len() as f64
        };
        let is_even = share(&|step| step.is_multiple_of(*shortest)) >= 1.0;
        if median <= MOST_FRAME_STEP || (is_even && *shortest <= MOST_EVEN_STEP) {
            return Ok((Self::Frames, "frames"));
        }
        // Whole multiples of the median are frames that were dropped.
        let is_regular = |step: u64| {
            let n = (step as f64 / median as f64).round().max(1.0);
            (step as f64 - n * median as f64).abs() <= ROUNDING * n * median as f64
        };
        let unit = UNITS
            .into_iter()
            .skip(1)
            .find(|(unit, _)| POSSIBLE_INTERVAL.contains(&median.saturating_mul(*unit)));
        let range = format!("{shortest} to {}", steps.last().unwrap_or(shortest));
        match unit {
            Some((unit, name))
                if (unit < 1_000_000 || share(&is_regular) >= MOST_STEPS) && fits(largest, unit) =>
            {
                Ok((Self::Time(unit), name))
            }
            _ => Err(format!(
                "numbers in the names of the images from {smallest} to {largest} in steps of {range}, which may be frames or times; \
                 --fps N takes them as frames at N a second, and a depth.txt with lines of: timestamp filename gives their times"
            )),
        }
    }

    /// Time of a number, nanoseconds; frames at a rate.
    pub(in crate::folder) fn nanos(self, value: u64, fps: f64) -> i64 {
        match self {
            Self::Frames => nanos_of(value as f64 / fps),
            Self::Time(unit) => i64::try_from(value.saturating_mul(unit)).unwrap_or(i64::MAX),
        }
    }
}

/// Seconds as nanoseconds; beyond what these hold the largest or smallest.
#[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
pub(crate) fn nanos_of(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

/// Counts of parts of a second of so many nanoseconds, from 2001 to 2106.
fn since_1970(unit: u64) -> std::ops::Range<u64> {
    let in_second = SECOND.checked_div(unit).unwrap_or(0);
    SINCE_1970_S.start.saturating_mul(in_second)..SINCE_1970_S.end.saturating_mul(in_second)
}

fn fits(value: u64, unit: u64) -> bool {
    value.checked_mul(unit).is_some_and(|nanos| i64::try_from(nanos).is_ok())
}

/// Whether a word counts parts of a second, of so many nanoseconds each, since 1970.
pub(super) fn is_since_1970(word: &str, unit: u64) -> bool {
    let since = since_1970(unit);
    word.parse().is_ok_and(|value| since.contains(&value))
}

/// The unit that all words count since 1970, by its name.
pub(super) fn unit_since_1970(words: &[&str]) -> Option<&'static str> {
    let is = |(unit, _): &(u64, &str)| words.iter().all(|word| is_since_1970(word, *unit));
    UNITS.into_iter().find(is).map(|(_, name)| name)
}

/// Whole numbers.
pub(super) fn values(words: &[&str]) -> Result<Vec<u64>, String> {
    let value = |word: &&str| {
        word.parse()
            .map_err(|_| format!("the number {word} in the name of an image, expected at most 19 digits"))
    };
    words.iter().map(value).collect()
}

/// Seconds and the digits behind their point.
pub(super) fn decimal(seconds: &[&str], fractions: &[&str]) -> Option<Vec<i64>> {
    let nanos = |(whole, fraction): (&&str, &&str)| {
        tessera_evaluation::parse_stamp(&format!("{whole}.{fraction}")).ok()
    };
    seconds.iter().zip(fractions).map(nanos).collect()
}

/// Seconds and a count of milli-, micro- or nanoseconds without leading zeros.
pub(super) fn counted(seconds: &[&str], parts: &[&str]) -> Option<Vec<i64>> {
    let (seconds, parts) = (values(seconds).ok()?, values(parts).ok()?);
    let largest = parts.iter().max()?;
    let (unit, _) = UNITS.into_iter().skip(1).find(|(unit, _)| largest.saturating_mul(*unit) < SECOND)?;
    let nanos = |(seconds, part): (&u64, &u64)| {
        i64::try_from(seconds.checked_mul(SECOND)?.checked_add(part.checked_mul(unit)?)?).ok()
    };
    seconds.iter().zip(&parts).map(nanos).collect()
}

/// Share of the steps between times that are near their median or a multiple of it; 0 where times repeat.
pub(super) fn regularity(times: &[i64]) -> f64 {
    const NEAR: f64 = 0.35;
    let mut sorted = times.to_vec();
    sorted.sort_unstable();
    let pairs = sorted.iter().zip(sorted.iter().skip(1));
    let mut steps: Vec<i64> = pairs.map(|(before, after)| after.saturating_sub(*before)).collect();
    steps.sort_unstable();
    let Some(&median) = steps.get(steps.len() / 2) else { return 1.0 };
    if steps.first().is_some_and(|step| *step <= 0) {
        return 0.0;
    }
    let is_near = |step: &&i64| {
        let n = (**step as f64 / median as f64).round();
        n >= 1.0 && (**step as f64 - n * median as f64).abs() <= NEAR * median as f64
    };
    steps.iter().filter(is_near).count() as f64 / steps.len() as f64
}
