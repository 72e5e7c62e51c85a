//! `rgb.txt` and `depth.txt`: one `timestamp filename` a line.

use crate::{ListError, SourceError};
use std::path::{Component, Path, PathBuf};
use tessera_evaluation::{format_stamp, parse_stamp};

/// One image of a list.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ListEntry {
    pub(super) stamp_nanos: i64,
    /// Relative to the folder.
    pub(super) file: PathBuf,
}

/// Reads a list; its times must increase.
pub(super) fn read(path: &Path) -> Result<Vec<ListEntry>, SourceError> {
    let bytes = std::fs::read(path).map_err(|source| SourceError::Io { path: path.to_owned(), source })?;
    parse(&String::from_utf8_lossy(&bytes), path)
}

fn parse(text: &str, path: &Path) -> Result<Vec<ListEntry>, SourceError> {
    let mut entries: Vec<ListEntry> = Vec::new();
    for (at, line) in text.lines().enumerate() {
        let line = line.trim_start_matches('\u{feff}').trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let entry = parse_line(line, entries.last()).map_err(|source| SourceError::List {
            path: path.to_owned(),
            line: at + 1,
            source,
        })?;
        entries.push(entry);
    }
    if entries.is_empty() {
        return Err(SourceError::EmptyList { path: path.to_owned() });
    }
    Ok(entries)
}

fn parse_line(line: &str, before: Option<&ListEntry>) -> Result<ListEntry, ListError> {
    let (stamp, file) = line
        .split_once([' ', '\t', ','])
        .map(|(stamp, file)| (stamp, file.trim_matches([' ', '\t', ','])))
        .filter(|(_, file)| !file.is_empty())
        .ok_or_else(|| ListError::Columns { found: line.to_owned() })?;
    let stamp_nanos = parse_stamp(stamp)?;
    if let Some(before) = before {
        if stamp_nanos == before.stamp_nanos {
            return Err(ListError::Repeated { found: format_stamp(stamp_nanos) });
        }
        if stamp_nanos < before.stamp_nanos {
            return Err(ListError::Unsorted {
                found: format_stamp(stamp_nanos),
                before: format_stamp(before.stamp_nanos),
            });
        }
    }
    let file = PathBuf::from(file);
    let inside = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    if !file.components().all(inside) {
        return Err(ListError::Outside { found: file.display().to_string() });
    }
    Ok(ListEntry { stamp_nanos, file })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_bad_line_is_named() {
        let table = [
            ("# only\n\n", "depth.txt names no images"),
            ("1.0 a.png\n1.0 b.png", "depth.txt, line 2: timestamp 1.000000 is repeated"),
            ("2.0 a.png\n1.5 b.png", "line 2: timestamp 1.500000 comes after 2.000000"),
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
        assert_eq!(list[0].file, Path::new("depth/a b.png"));
        assert_eq!((list.len(), list[1].stamp_nanos), (2, 2_500_000_000));
    }
}
