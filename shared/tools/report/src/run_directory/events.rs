//! Warnings and errors of the log.

use crate::Event;
use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;

/// Lines kept: the newest.
const MOST: usize = 60;

/// Warnings and errors of a log, oldest first, and how many before them are left out.
pub(super) fn read(log: &Path) -> (Vec<Event>, usize) {
    let Ok(file) = File::open(log) else { return (Vec::new(), 0) };
    let mut newest = VecDeque::new();
    let mut n_more = 0_usize;
    for line in BufReader::new(file).split(b'\n').map_while(Result::ok) {
        let Some(event) = event(&String::from_utf8_lossy(&line)) else { continue };
        if newest.len() == MOST {
            newest.pop_front();
            n_more = n_more.saturating_add(1);
        }
        newest.push_back(event);
    }
    (newest.into(), n_more)
}

/// `2026-11-21T08:00:00.000000Z  WARN supervisor[4711] frame=12 align died: …`
fn event(line: &str) -> Option<Event> {
    let (stamp, rest) = line.split_once(' ')?;
    let (level, words) = rest.trim_start().split_once(' ')?;
    if !["WARN", "ERROR"].contains(&level) {
        return None;
    }
    let time = stamp.split_once('T')?.1.trim_end_matches('Z');
    let time = time.get(..12).unwrap_or(time).to_owned();
    Some(Event { time, level: level.to_owned(), words: words.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_are_told_and_the_rest_is_not() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.txt");
        let mut text = String::from("2026-11-21T08:00:00.123456Z  INFO align[7] ready\nnonsense\n\n");
        for k in 0..70 {
            text += &format!("2026-11-21T08:00:01.{k:06}Z  WARN supervisor[1] align died {k}\n");
        }
        std::fs::write(&path, text).unwrap();
        let (events, n_more) = read(&path);
        assert_eq!((events.len(), n_more), (60, 10));
        assert_eq!(events[0].words, "supervisor[1] align died 10");
        assert_eq!((events[0].time.as_str(), events[0].level.as_str()), ("08:00:01.000", "WARN"));
        assert_eq!(read(&dir.path().join("none")), (Vec::new(), 0));
    }
}
