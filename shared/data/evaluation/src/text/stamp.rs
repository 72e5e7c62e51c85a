//! Timestamps: decimal seconds in files, whole nanoseconds in memory.

/// Why a word is not a timestamp.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StampError {
    /// The word is not a decimal number.
    #[error("timestamp is '{found}', expected seconds as a decimal number such as 1305031453.374112")]
    NotANumber {
        /// The word found.
        found: String,
    },
    /// The number does not fit nanoseconds in 64 bits.
    #[error("timestamp is '{found}', expected seconds between -9e9 and 9e9")]
    Range {
        /// The word found.
        found: String,
    },
}

/// Times of recordings, nanoseconds since 1970: from the year 2001 to 2106.
const SINCE_1970: std::ops::Range<i64> = 1_000_000_000_000_000_000..4_294_967_296_000_000_000;

/// Reads a time as nanoseconds: decimal seconds, or milli-, micro- or nanoseconds since 1970, which are too
/// large for seconds.
///
/// # Errors
/// The word is not a finite decimal number, or too large.
pub fn parse_stamp(word: &str) -> Result<i64, StampError> {
    let counted = |shift| parse_seconds(word, shift).ok().filter(|nanos| SINCE_1970.contains(nanos));
    match parse_seconds(word, 0) {
        Err(range @ StampError::Range { .. }) => [-3, -6, -9].into_iter().find_map(counted).ok_or(range),
        parsed => parsed,
    }
}

/// Reads a decimal number times `10^shift` seconds without going through a float, which would lose digits:
/// an `f64` near 1.3e9 s resolves 0.24 microseconds. Exponents (`1.3e+09`, as numpy writes them)
/// are read, digits beyond the ninth decimal are rounded.
#[expect(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "places of digits of a word in memory, an exponent of 60 at most, and nanoseconds bounded before each step"
)]
fn parse_seconds(word: &str, shift: i32) -> Result<i64, StampError> {
    let wrong = || StampError::NotANumber { found: word.to_owned() };
    let range = || StampError::Range { found: word.to_owned() };
    let (negative, unsigned) = match word.as_bytes().first() {
        Some(b'-') => (true, &word[1..]),
        Some(b'+') => (false, &word[1..]),
        _ => (false, word),
    };
    let (mantissa, exponent) = match unsigned.find(['e', 'E']) {
        Some(at) => {
            let (mantissa, exponent) = unsigned.split_at(at);
            (mantissa, exponent.get(1..).unwrap_or_default().parse::<i32>().map_err(|_| wrong())?)
        }
        None => (unsigned, 0),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = || whole.bytes().chain(fraction.bytes());
    if digits().next().is_none() || !digits().all(|b| b.is_ascii_digit()) || exponent.abs() > 60 {
        return Err(wrong());
    }
    // Digit k (from 0) of the mantissa stands for 10^(whole.len() - 1 - k + exponent) seconds.
    let top = whole.len() as i32 - 1 + exponent + shift + 9;
    let mut nanos: i64 = 0;
    let mut round_up = false;
    for (k, digit) in digits().enumerate() {
        let place = top - k as i32;
        let digit = i64::from(digit - b'0');
        if place >= 0 {
            if nanos > i64::MAX / 10 - 1 {
                return Err(range());
            }
            nanos = nanos * 10 + digit;
        } else {
            round_up = place == -1 && digit >= 5;
            break;
        }
    }
    // Zeros that the word left out between its last digit and the nanosecond.
    let last_place = top - (whole.len() + fraction.len()) as i32 + 1;
    if nanos != 0 {
        for _ in 0..last_place.max(0) {
            nanos = nanos.checked_mul(10).ok_or_else(range)?;
        }
    }
    nanos += i64::from(round_up);
    if nanos > 9_000_000_000_000_000_000 {
        return Err(range());
    }
    Ok(if negative { -nanos } else { nanos })
}

/// Decimal seconds with six digits after the point, and up to nine where the stamp has them.
pub fn format_stamp(stamp_nanos: i64) -> String {
    let sign = if stamp_nanos < 0 { "-" } else { "" };
    let nanos = stamp_nanos.unsigned_abs();
    let mut text = format!("{sign}{}.{:09}", nanos / 1_000_000_000, nanos % 1_000_000_000);
    while text.ends_with('0') && text.len().saturating_sub(text.find('.').unwrap_or(0)) > 7 {
        text.pop();
    }
    text
}

/// The `f64` nearest to the stamp in seconds: what Python's `float()` makes of the text in a file.
pub fn stamp_seconds(stamp_nanos: i64) -> f64 {
    // Through the decimal text, because nanoseconds of today do not fit 53 bits and a division
    // would round twice. A number that was just formatted always parses.
    format_stamp(stamp_nanos).parse().unwrap_or(stamp_nanos as f64 * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimal_seconds_become_nanoseconds_exactly() {
        let table = [
            ("1305031453.374112", 1_305_031_453_374_112_000),
            ("0.000000", 0),
            ("0.033333", 33_333_000),
            ("12", 12_000_000_000),
            (".5", 500_000_000),
            ("5.", 5_000_000_000),
            ("-0.25", -250_000_000),
            ("+1.000000001", 1_000_000_001),
            ("1.305031453374112e+09", 1_305_031_453_374_112_000),
            ("1e-3", 1_000_000),
            ("1.0000000004", 1_000_000_000),
            ("1.0000000005", 1_000_000_001),
            ("1E2", 100_000_000_000),
            ("3e-10", 0),
            ("0001.5", 1_500_000_000),
        ];
        for (word, nanos) in table {
            assert_eq!(parse_stamp(word), Ok(nanos), "{word}");
        }
    }

    #[test]
    fn parts_of_a_second_since_1970_are_known_by_their_size() {
        for word in ["1700000000033.25", "1700000000033250", "1700000000033250000", "1.70000000003325e12"] {
            assert_eq!(parse_stamp(word), Ok(1_700_000_000_033_250_000), "{word}");
        }
        assert_eq!(parse_stamp("1700000000033333333"), Ok(1_700_000_000_033_333_333));
    }

    #[test]
    fn words_that_are_no_time_are_refused() {
        for word in ["", "-", ".", "nan", "inf", "1.2.3", "1e", "0x10", "1e99", "rgb/1.png", "1,5", "é"] {
            assert!(matches!(parse_stamp(word), Err(StampError::NotANumber { .. })), "{word}");
        }
        assert!(matches!(parse_stamp("1e10"), Err(StampError::Range { .. })));
        assert!(matches!(parse_stamp("99999999999999999999"), Err(StampError::Range { .. })));
    }

    #[test]
    fn stamps_print_like_they_were_read() {
        for word in ["1305031453.374112", "0.000000", "-0.250000", "1700000000.123456789"] {
            assert_eq!(format_stamp(parse_stamp(word).unwrap()), word);
        }
        assert_eq!(format_stamp(1_500_000_000), "1.500000");
        assert_eq!(stamp_seconds(1_305_031_453_374_112_000), 1305031453.374112);
        assert_eq!(stamp_seconds(i64::MIN), -9_223_372_036.854_776);
    }
}
