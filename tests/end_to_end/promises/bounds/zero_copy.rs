//! Nothing is copied behind the producer's one write: what the algorithms are handed in the real
//! stages lies in shared memory, as `/proc/self/maps` says.

use crate::common::{Run, room};

/// Files in which slices of that name lay, one entry for each frame that was looked at.
fn places(run: &Run, stage: &str, what: &str) -> Vec<(u64, String)> {
    let (mark, words) = (format!(" {stage}["), format!("] {what} lies in "));
    let log = run.log();
    let lines = log.lines().filter(|line| line.contains(&mark));
    let mut places: Vec<(u64, String)> = lines
        .filter_map(|line| {
            let (_, rest) = line.split_once(&words)?;
            let (place, frame) = rest.rsplit_once(" frame=")?;
            Some((frame.trim().parse().unwrap(), place.trim().to_owned()))
        })
        .collect();
    places.sort();
    places
}

fn assert_in_shared_memory(run: &Run, stage: &str, what: &str, frames: std::ops::Range<u64>) {
    let places = places(run, stage, what);
    let segments = format!("/dev/shm/{}", run.prefix());
    for (frame, place) in &places {
        assert!(
            place.starts_with(&segments),
            "{what} of frame {frame} lies in {place}, expected {segments}…"
        );
    }
    let found: Vec<u64> = places.iter().map(|(frame, _)| *frame).collect();
    assert_eq!(found, frames.collect::<Vec<_>>(), "{stage}: {what}");
}

#[test]
fn the_algorithms_read_and_write_in_the_mapped_segments() {
    let run = room().with_env("TESSERA_PROBE", "1");
    assert!(run.finish().success());
    let n: u64 = crate::common::FRAMES.parse().unwrap();
    for what in ["depth", "colour", "the surface made"] {
        assert_in_shared_memory(&run, "reconstruct", what, 0..n);
    }
    assert_in_shared_memory(&run, "align", "the surface", 0..n);
    assert_in_shared_memory(&run, "align", "a recent surface", 1..n);
}
