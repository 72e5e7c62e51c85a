//! Dates in names: `20231114_221320_123`, `2023-11-14T22-13-20.123456`, `20231114221320123`.

use super::Pieces;
use super::clock::SECOND;

/// Digits of a date with its time to the second.
const DIGITS: usize = 14;
/// Digits behind which one of its numbers may end: year, month, day, hours, minutes, seconds.
const ENDS: [usize; 6] = [4, 6, 8, 10, 12, DIGITS];
/// Digits of a fraction that nanoseconds hold.
const MOST_FRACTION: usize = 9;
const YEARS: std::ops::Range<i64> = 2001..2107;

/// Nanoseconds since 1970 of names that hold a date, all at the same place; `None`: they hold none.
/// The clock on the wall is taken as that of Greenwich.
pub(super) fn times(rows: &[&Pieces<'_>]) -> Option<Vec<i64>> {
    let first = rows.first()?;
    (0..first.digits.len()).find_map(|begin| rows.iter().map(|row| time(&row.digits[begin..])).collect())
}

/// The time that numbers begin with, and a fraction of a second behind it.
fn time(numbers: &[&str]) -> Option<i64> {
    let mut digits = String::new();
    let mut rest = numbers.iter();
    while digits.len() < DIGITS {
        if !digits.is_empty() && !ENDS.contains(&digits.len()) {
            return None;
        }
        digits.push_str(rest.next()?);
    }
    let (date, mut fraction) = digits.split_at_checked(DIGITS)?;
    if fraction.is_empty() {
        fraction = rest.next().copied().unwrap_or_default();
    }
    let number = |from: usize, to: usize| date.get(from..to)?.parse::<i64>().ok();
    let [year, month, day] = [number(0, 4)?, number(4, 6)?, number(6, 8)?];
    let [hours, minutes, seconds] = [number(8, 10)?, number(10, 12)?, number(12, DIGITS)?];
    let is_date = YEARS.contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day);
    // A leap second is one, too.
    if !is_date || hours > 23 || minutes > 59 || seconds > 60 || fraction.len() > MOST_FRACTION {
        return None;
    }
    let since = ((days(year, month, day) * 24 + hours) * 60 + minutes) * 60 + seconds;
    let nanos: i64 = format!("{fraction:0<MOST_FRACTION$}").parse().ok()?;
    Some(since.saturating_mul(SECOND as i64).saturating_add(nanos))
}

/// Days since 1970 of the Gregorian calendar: years begin in March, so that a leap day is the last one.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let of_year = (153 * month + 2) / 5 + day - 1;
    365 * year + year / 4 - year / 100 + year / 400 + of_year - 719_468
}
