//! `rgb.txt` and `depth.txt`: one `timestamp filename` a line.

use super::names::NameClock;
use crate::{ListError, SourceError};
use std::path::{Component, Path, PathBuf};
use tessera_evaluation::{StampError, parse_stamp, plain_text};
use tessera_frames::timeline::{ImageOrder, RecordedImage, timelines};

/// One image of a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ListEntry {
    pub(super) stamp_nanos: i64,
    /// Relative to the folder.
    pub(super) file: PathBuf,
}

/// The images of a list in its order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct ImageList {
    pub(super) entries: Vec<ListEntry>,
    /// The stamps are frame numbers, counted in seconds here.
    pub(super) is_numbered: bool,
}

/// Reads a list.
pub(super) fn read(path: &Path) -> Result<ImageList, SourceError> {
    let bytes = std::fs::read(path).map_err(|source| SourceError::Io { path: path.to_owned(), source })?;
    parse(&plain_text(&bytes), path)
}

fn parse(text: &str, path: &Path) -> Result<ImageList, SourceError> {
    let mut lines: Vec<(usize, String, PathBuf)> = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') || (lines.is_empty() && is_heading(line)) {
            continue;
        }
        let (stamp, file) = parse_line(line).map_err(|source| wrong(path, number, source))?;
        lines.push((number, stamp, file));
    }
    if lines.is_empty() {
        return Err(SourceError::EmptyList { path: path.to_owned() });
    }
    let words: Vec<&str> = lines.iter().map(|(_, stamp, _)| stamp.as_str()).collect();
    let (stamps, is_numbered) = stamps(&words).map_err(|(at, source)| {
        let number = lines.get(at).map_or(0, |(number, ..)| *number);
        wrong(path, number, source.into())
    })?;
    let entries =
        lines.into_iter().zip(stamps).map(|((_, _, file), stamp_nanos)| ListEntry { stamp_nanos, file });
    Ok(ImageList { entries: entries.collect(), is_numbered })
}

fn wrong(path: &Path, line: usize, source: ListError) -> SourceError {
    SourceError::List { path: path.to_owned(), line, source }
}

/// Whether a line names columns: a table of another program has no `#` before them.
fn is_heading(line: &str) -> bool {
    !line.contains(|c: char| c.is_ascii_digit() || c == '.')
}

/// Whether a path that a file of a recording names stays in its folder.
pub(crate) fn is_inside(file: &Path) -> bool {
    file.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}

/// What separates a time from a file name.
pub(super) const SEPARATORS: [char; 4] = [' ', '\t', ',', ';'];

fn parse_line(line: &str) -> Result<(String, PathBuf), ListError> {
    let columns = || ListError::Columns { found: line.to_owned() };
    let (stamp, rest) = line.split_once(SEPARATORS).ok_or_else(columns)?;
    let (stamp, rest) = match decimal_comma(line) {
        Some((stamp, rest)) => (stamp, rest),
        None => (stamp.to_owned(), rest),
    };
    let file = rest.trim_matches(SEPARATORS).trim_matches(['"', '\'']);
    if file.is_empty() {
        return Err(columns());
    }
    // As Windows writes a path.
    let file = PathBuf::from(file.replace('\\', "/"));
    if !is_inside(&file) {
        return Err(ListError::Outside { found: file.display().to_string() });
    }
    Ok((stamp, file))
}

/// A time whose fraction is behind a comma, and what follows it.
fn decimal_comma(line: &str) -> Option<(String, &str)> {
    let (whole, rest) = line.split_once(',')?;
    let (fraction, rest) = rest.split_once(SEPARATORS)?;
    let is_number = |word: &str| !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit());
    (is_number(whole) && is_number(fraction)).then(|| (format!("{whole}.{fraction}"), rest))
}

/// Stamps of a list, nanoseconds: decimal seconds, or whole milli-, micro- or nanoseconds where all of
/// them are; and whether they are frame numbers.
///
/// # Errors
/// The place of the first that is no time.
pub(super) fn stamps(words: &[&str]) -> Result<(Vec<i64>, bool), (usize, StampError)> {
    let whole: Option<Vec<u64>> = words.iter().map(|word| word.parse().ok()).collect();
    let clock = whole.as_deref().and_then(|values| NameClock::of(values).ok()).map(|(clock, _)| clock);
    if let Some((values, NameClock::Time(_))) = whole.as_deref().zip(clock) {
        return Ok((
            values.iter().map(|value| clock.map_or(0, |clock| clock.nanos(*value, 1.0))).collect(),
            false,
        ));
    }
    let stamps = words.iter().enumerate().map(|(at, word)| parse_stamp(word).map_err(|source| (at, source)));
    let stamps: Vec<i64> = stamps.collect::<Result<_, _>>()?;
    let is_counted = whole.is_some_and(|values| values.iter().any(|value| Some(value) != values.first()));
    Ok((stamps, is_counted && clock == Some(NameClock::Frames)))
}

/// Depth and colour in the order of their times, and what was found wrong with these; whether a new
/// stretch of time begins.
pub(super) fn in_order(
    depth: Vec<ListEntry>,
    colour: Vec<ListEntry>,
    names: [&str; 2],
) -> (Vec<ListEntry>, Vec<ListEntry>, Vec<String>) {
    let recorded = |entries: &[ListEntry]| -> Vec<RecordedImage> {
        let n = entries.len().max(1) as u64;
        let ordinal = |at: u64| (at << 24).checked_div(n).unwrap_or(0);
        let of = |(at, entry): (u64, &ListEntry)| RecordedImage {
            stamp_nanos: entry.stamp_nanos,
            log_nanos: None,
            ordinal: ordinal(at),
        };
        (0..).zip(entries).map(of).collect()
    };
    let found = timelines(&recorded(&depth), &recorded(&colour), names);
    let ordered = |timeline: &ImageOrder, entries: &[ListEntry]| -> Vec<ListEntry> {
        let entry = |(at, stamp): (&usize, &i64)| {
            Some(ListEntry { stamp_nanos: *stamp, file: entries.get(*at)?.file.clone() })
        };
        timeline.order.iter().zip(&timeline.stamps_nanos).filter_map(entry).collect()
    };
    (ordered(&found.depth, &depth), ordered(&found.colour, &colour), found.sentences)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_bad_line_is_named() {
        let table = [
            ("# only\n\n", "depth.txt names no images"),
            ("1.0", "line 1: found '1.0', expected: timestamp filename"),
            ("# c\nx a.png", "line 2: timestamp is 'x', expected seconds"),
            ("1 ../../etc/passwd", "filename is '../../etc/passwd', expected a path inside the folder"),
            ("1 /etc/passwd", "expected a path inside the folder"),
        ];
        for (text, expected) in table {
            let found = parse(text, Path::new("depth.txt")).unwrap_err().to_string();
            assert!(found.contains(expected), "'{found}' lacks '{expected}'");
        }
    }

    #[test]
    fn names_may_hold_spaces_and_lists_end_without_newline() {
        let list = parse("1.5\tdepth/a b.png\r\n2.5 ./c.png", Path::new("x")).unwrap();
        assert_eq!(list.entries[0].file, Path::new("depth/a b.png"));
        assert_eq!((list.entries.len(), list.entries[1].stamp_nanos), (2, 2_500_000_000));
    }

    #[test]
    fn lists_of_spreadsheets_and_of_windows_are_read() {
        let rows = [
            "1.5;depth/1.png",
            "1,5;depth/1.png",
            "1,5 depth/1.png",
            "1.5, depth\\1.png",
            "1.5 \"depth/1.png\"",
            "1500000000000.0 depth/1.png",
            "time;file name\n1.5;depth/1.png",
        ];
        for row in rows {
            let list = parse(&format!("{row}\n"), Path::new("x")).unwrap();
            let nanos = if row.starts_with("15") { 1_500_000_000_000_000_000 } else { 1_500_000_000 };
            assert_eq!(list.entries, [ListEntry { stamp_nanos: nanos, file: "depth/1.png".into() }], "{row}");
        }
        assert!(parse("1 ..\\a.png", Path::new("x")).unwrap_err().to_string().contains("inside the folder"));
        // A comma between a whole time and a name that is a number.
        assert_eq!(parse("1,2.png\n2,3.png", Path::new("x")).unwrap().entries[1].file, Path::new("3.png"));
        let nan = parse("nan depth/4.png", Path::new("x")).unwrap_err().to_string();
        assert!(nan.contains("timestamp is 'nan'"), "{nan}");
    }

    #[test]
    fn whole_stamps_are_known_by_their_digits_and_steps() {
        let start = 1_700_000_000_000_000_000_i64;
        for (unit, name) in [(1, "nano"), (1000, "micro"), (1_000_000, "milli")] {
            let words: Vec<String> = (0..5).map(|k| ((start + k * 33_000_000) / unit).to_string()).collect();
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let expected: Vec<i64> = (0..5).map(|k| start + k * 33_000_000).collect();
            assert_eq!(stamps(&words), Ok((expected, false)), "{name}");
        }
        let second = 1_000_000_000;
        assert_eq!(stamps(&["1", "2", "3"]), Ok((vec![second, 2 * second, 3 * second], true)));
        assert_eq!(stamps(&["0", "0", "0"]), Ok((vec![0, 0, 0], false)));
        assert_eq!(stamps(&["1700000000", "1700000001"]).map(|found| found.1), Ok(false));
        assert_eq!(stamps(&["1.0", "2.0"]), Ok((vec![second, 2 * second], false)));
        assert_eq!(stamps(&["1", "x"]).unwrap_err().0, 1);
    }
}
