//! Numbers and times in the names of images: frame numbers, or stamps in seconds with a fraction, in
//! seconds and nanoseconds, in milli-, micro- or nanoseconds, or as a date.
//!
//! Stamps are recognised by their digits (a time since 1970 has 10 of them in seconds, 19 in
//! nanoseconds) and by their steps; what may be either is refused with what to give.
#![expect(
    clippy::indexing_slicing,
    clippy::arithmetic_side_effects,
    reason = "indices of the names and of their pieces, of which all rows have as many as the first"
)]

mod calendar;
mod clock;

pub(crate) use clock::nanos_of;
pub(super) use clock::{MOST_FRAME_STEP, NameClock};
use clock::{SECOND, regularity};

/// Share of regular steps from which on a reading is believed.
const REGULAR: f64 = 0.7;
/// What gives the times of names that are not understood.
const LIST: &str = "a depth.txt with lines of: timestamp filename gives their times";
/// Cameras whose images lie in one folder, and takes.
const MOST_CAMERAS: usize = 8;
/// Names that a sentence shows.
const MOST_SHOWN: usize = 2;

/// What the names of a list of images mean.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum NameMeaning {
    /// Frame numbers.
    Numbers(Vec<u64>),
    /// Nanoseconds, and how they are written, for people.
    Times(Vec<i64>, String),
}

/// Names that were understood.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Understood {
    /// Indices of the names that have the common form.
    pub(super) kept: Vec<usize>,
    /// One value for each of them.
    pub(super) meaning: NameMeaning,
    /// Names that were left out, as a sentence.
    pub(super) warning: Option<String>,
}

/// A name in pieces: `texts[0] digits[0] texts[1] ...`.
struct Pieces<'a> {
    texts: Vec<&'a str>,
    digits: Vec<&'a str>,
}

impl<'a> Pieces<'a> {
    fn of(stem: &'a str) -> Self {
        let (mut texts, mut digits, mut rest) = (Vec::new(), Vec::new(), stem);
        loop {
            let at = rest.find(|c: char| c.is_ascii_digit()).unwrap_or(rest.len());
            texts.push(&rest[..at]);
            rest = &rest[at..];
            if rest.is_empty() {
                return Self { texts, digits };
            }
            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            digits.push(&rest[..end]);
            rest = &rest[end..];
        }
    }
}

/// Understands the stems of file names; numbers that may be frames or times are frames where a rate is
/// given.
///
/// # Errors
/// What was found and expected, without the folder: names of several forms, or numbers of no known
/// meaning.
pub(super) fn understand(stems: &[&str], is_rate_given: bool) -> Result<Understood, String> {
    let all: Vec<Pieces<'_>> = stems.iter().map(|stem| Pieces::of(stem)).collect();
    let numbered: Vec<usize> = (0..all.len()).filter(|at| !all[*at].digits.is_empty()).collect();
    let count = |at: usize| numbered.iter().filter(|other| all[**other].texts == all[at].texts).count();
    // The first of several that are as frequent.
    let common = numbered.iter().rev().copied().max_by_key(|at| count(*at));
    let Some(common) = common else {
        return Ok(Understood { kept: Vec::new(), meaning: NameMeaning::Numbers(Vec::new()), warning: None });
    };
    let kept: Vec<usize> =
        numbered.iter().copied().filter(|at| all[*at].texts == all[common].texts).collect();
    if 2 * kept.len() <= numbered.len() && numbered.len() > 1 {
        let other =
            numbered.iter().find(|at| all[**at].texts != all[common].texts).map_or("", |at| stems[*at]);
        return Err(format!(
            "names of several forms, as '{}' and '{other}', expected one; {LIST}",
            stems[common]
        ));
    }
    let left_out: Vec<&str> = (0..stems.len()).filter(|at| !kept.contains(at)).map(|at| stems[at]).collect();
    let warning = (!left_out.is_empty()).then(|| {
        let shown = left_out.iter().take(MOST_SHOWN).copied().collect::<Vec<&str>>().join(", ");
        let more = if left_out.len() > MOST_SHOWN { ", ..." } else { "" };
        format!(
            "{} images are left out, their names have another form than '{}': {shown}{more}",
            left_out.len(),
            stems[common]
        )
    });
    let rows: Vec<&Pieces<'_>> = kept.iter().map(|at| &all[*at]).collect();
    let meaning = meaning(&rows, is_rate_given)?;
    Ok(Understood { kept, meaning, warning })
}

/// The meaning of names of one form.
fn meaning(rows: &[&Pieces<'_>], is_rate_given: bool) -> Result<NameMeaning, String> {
    let Some(first) = rows.first() else { return Ok(NameMeaning::Numbers(Vec::new())) };
    if let Some(times) = calendar::times(rows) {
        return Ok(NameMeaning::Times(times, "dates in the names of the images".to_owned()));
    }
    let is_varying = |at: &usize| rows.iter().any(|row| row.digits[*at] != first.digits[*at]);
    let mut columns: Vec<usize> = (0..first.digits.len()).filter(is_varying).collect();
    if columns.is_empty() {
        // A single image: its last number, or seconds with a fraction.
        let n = first.digits.len();
        columns = if n > 1 && first.texts[n - 1] == "." { vec![n - 2, n - 1] } else { vec![n - 1] };
    }
    // A time whose seconds or nanoseconds do not change is one all the same.
    if let [only] = columns[..] {
        let beside =
            |at: usize| at + 1 < first.digits.len() && clock::is_since_1970(first.digits[at], SECOND);
        if only > 0 && beside(only - 1) {
            columns = vec![only - 1, only];
        } else if first.texts.get(only + 1) == Some(&".") && beside(only) {
            columns = vec![only, only + 1];
        }
    }
    // A running number before the time says nothing more.
    while columns.len() > 2 && is_running(&column(rows, columns[0])) {
        columns.remove(0);
    }
    match columns[..] {
        [only] => single(&column(rows, only), is_rate_given),
        [a, b] if b == a + 1 => pair(&column(rows, a), &column(rows, b), first.texts[b], is_rate_given),
        [a, b] if is_running(&column(rows, a)) => single(&column(rows, b), is_rate_given),
        _ => Err(format!(
            "names with {} numbers that change, expected a frame number, or a time in seconds, sec_nsec, milli-, micro- or nanoseconds; {LIST}",
            columns.len()
        )),
    }
}

fn column<'a>(rows: &[&Pieces<'a>], at: usize) -> Vec<&'a str> {
    rows.iter().map(|row| row.digits[at]).collect()
}

/// Whether numbers count images: all different and in small steps.
fn is_running(words: &[&str]) -> bool {
    let Ok(mut values) = clock::values(words) else { return false };
    values.sort_unstable();
    let is_small = |pair: &[u64]| pair[1] > pair[0] && pair[1] - pair[0] <= clock::MOST_FRAME_STEP;
    values.windows(2).all(is_small) && !clock::is_since_1970(words[0], SECOND)
}

/// Whether one number names a few cameras, each of which has the images that the other one counts.
fn is_of_cameras(cameras: &[&str], images: &[&str]) -> bool {
    let distinct = |words: &[&str]| -> Vec<u64> {
        let mut values = clock::values(words).unwrap_or_default();
        values.sort_unstable();
        values.dedup();
        values
    };
    let (cameras, counted) = (distinct(cameras), distinct(images));
    let is_counted = |pair: &[u64]| pair[1] - pair[0] <= clock::MOST_FRAME_STEP;
    (2..=MOST_CAMERAS).contains(&cameras.len())
        && cameras.windows(2).all(|pair| pair[1] - pair[0] == 1)
        && cameras[0] <= 1
        && counted.len() > cameras.len()
        && counted.windows(2).all(is_counted)
        // One image may be missing here and there.
        && 10 * images.len() >= 9 * cameras.len() * counted.len()
}

/// One number a name.
fn single(words: &[&str], is_rate_given: bool) -> Result<NameMeaning, String> {
    let values = clock::values(words)?;
    let (clock, how) = match NameClock::of(&values) {
        Err(_) if is_rate_given => (NameClock::Frames, "frames"),
        found => found?,
    };
    match clock {
        NameClock::Frames => Ok(NameMeaning::Numbers(values)),
        NameClock::Time(_) => {
            let times = values.iter().map(|value| clock.nanos(*value, 1.0)).collect();
            Ok(NameMeaning::Times(times, format!("{how} in the names of the images")))
        }
    }
}

/// Two numbers a name: seconds and a fraction of them, or a running number and a time.
fn pair(a: &[&str], b: &[&str], between: &str, is_rate_given: bool) -> Result<NameMeaning, String> {
    let is_since_1970 = a.iter().all(|word| clock::is_since_1970(word, SECOND));
    if between != "." && (is_of_cameras(a, b) || is_of_cameras(b, a)) {
        return Err(format!(
            "names with two numbers that count, as '{}{between}{}' and '{}{between}{}', images of several cameras or takes? expected those of one; {LIST}",
            a[0],
            b[0],
            a.last().unwrap_or(&""),
            b.last().unwrap_or(&"")
        ));
    }
    if between != "." && !is_since_1970 && is_running(a) {
        return match single(b, is_rate_given)? {
            // As `12_12`: both count.
            NameMeaning::Numbers(_) => Ok(NameMeaning::Numbers(clock::values(a)?)),
            times => Ok(times),
        };
    }
    let mut readings = [
        (clock::decimal(a, b), clock::unit_since_1970(a).unwrap_or("seconds")),
        (clock::counted(a, b), "seconds and their parts"),
    ];
    if between != "." {
        readings.reverse();
    }
    let fractions: Vec<(Vec<i64>, &str)> =
        readings.into_iter().filter_map(|(times, how)| Some((times?, how))).collect();
    let best = fractions
        .into_iter()
        .map(|(times, how)| (regularity(&times), times, how))
        // The first of several that are as regular.
        .reduce(|best, other| if other.0 > best.0 { other } else { best });
    match best {
        Some((regular, times, how))
            if regular >= REGULAR
                || (is_since_1970 || between == ".") && regular > 0.0
                || times.len() < 3 =>
        {
            Ok(NameMeaning::Times(times, format!("{how} in the names of the images")))
        }
        _ => Err(format!(
            "names with numbers as '{}{between}{}', expected a frame number, or a time in seconds, sec_nsec, milli-, micro- or nanoseconds; {LIST}",
            a[0], b[0]
        )),
    }
}

#[cfg(test)]
mod tests;
