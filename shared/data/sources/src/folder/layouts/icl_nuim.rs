//! ICL-NUIM: `associations.txt` with lines `number depth/0.png number rgb/0.png`, and poses in
//! `livingRoom0.gt.freiburg` by the same numbers. Associations with times are read as well.

use super::super::list::ListEntry;
use super::files::{names, number_nanos, text, wrong};
use super::{Asked, FoundLayout, tum};
use crate::SourceError;
use std::path::{Component, Path, PathBuf};
use tessera_evaluation::{Trajectory, parse_stamp, read_tum};
use tessera_frames::cameras::named_camera;

pub(super) const NAME: &str = "ICL-NUIM (associations.txt)";

const LIST: &str = "associations.txt";
const SECOND: i64 = 1_000_000_000;

pub(super) fn is(folder: &Path) -> bool {
    folder.join(LIST).is_file()
}

pub(super) fn read(folder: &Path, asked: &Asked) -> Result<FoundLayout, SourceError> {
    let path = folder.join(LIST);
    let mut rows: Vec<AssociationRow> = Vec::new();
    for (at, line) in text(&path)?.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let row = AssociationRow::parse(line).ok_or_else(|| {
            wrong(
                &path,
                format!("line {}: found '{line}', expected: number depth/FILE number rgb/FILE", at + 1),
            )
        })?;
        rows.push(row);
    }
    rows.sort_by_key(|row| row.depth.stamp_nanos);
    rows.dedup_by_key(|row| row.depth.stamp_nanos);
    if rows.is_empty() {
        return Err(SourceError::EmptyList { path });
    }
    let is_numbered = rows.iter().all(|row| row.depth.stamp_nanos % SECOND == 0);
    let camera = asked.camera(folder, || match is_numbered {
        true => Ok(Some((named_camera("icl")?, "icl, that of ICL-NUIM".to_owned()))),
        false => tum::camera_by_name(folder),
    })?;
    let (fps, stamps) = asked.rate();
    let time =
        |nanos: i64| if is_numbered { number_nanos((nanos / SECOND).unsigned_abs(), fps) } else { nanos };
    let entry = |entry: ListEntry| ListEntry { stamp_nanos: time(entry.stamp_nanos), ..entry };
    let (depth, mut colour): (Vec<ListEntry>, Vec<ListEntry>) =
        rows.into_iter().map(|row| (entry(row.depth), entry(row.colour))).unzip();
    colour.sort_by_key(|entry| entry.stamp_nanos);
    let mut found = FoundLayout::new(NAME, camera, depth, colour);
    found.ground_truth = ground_truth(folder, &time)?;
    if is_numbered {
        found.notes.push(("times", stamps));
    }
    Ok(found)
}

/// Poses by number or time, as the images have.
fn ground_truth(folder: &Path, time: &impl Fn(i64) -> i64) -> Result<Option<Trajectory>, SourceError> {
    let names = names(folder);
    let name = names.iter().find(|name| name.ends_with(".gt.freiburg") || *name == "groundtruth.txt");
    let Some(name) = name else { return Ok(None) };
    let by_number = read_tum(&folder.join(name))?;
    let mut truth = Trajectory::default();
    for (stamp, pose) in by_number.stamps_nanos.iter().zip(&by_number.poses) {
        // Stamps that rise rise at any rate.
        let _ = truth.push(time(*stamp), *pose);
    }
    Ok(Some(truth))
}

/// One pair of images.
struct AssociationRow {
    depth: ListEntry,
    colour: ListEntry,
}

impl AssociationRow {
    /// Reads a line; which of the two images is depth is said by its path.
    fn parse(line: &str) -> Option<Self> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let [a, a_file, b, b_file] = words[..] else { return None };
        let entry = |stamp: &str, file: &str| {
            let file = PathBuf::from(file);
            let is_inside = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
            let stamp_nanos = parse_stamp(stamp).ok().filter(|_| file.components().all(is_inside))?;
            Some(ListEntry { stamp_nanos, file })
        };
        let (first, second) = (entry(a, a_file)?, entry(b, b_file)?);
        match (a_file.contains("depth"), b_file.contains("depth")) {
            (true, false) => Some(Self { depth: first, colour: second }),
            (false, true) => Some(Self { depth: second, colour: first }),
            _ => None,
        }
    }
}
