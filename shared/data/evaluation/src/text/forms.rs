//! Trajectory files by their form: TUM, TUM with whole nanoseconds, EuRoC, KITTI, and what else an export writes.

use crate::text::file::{ROTATION_TOLERANCE, ReadError, Trajectory, of_matrix, parse_tum};
use crate::text::nerf;
use crate::text::plain::{WHOLE_DIGITS, columns as words, plain_text};
use nalgebra::{Matrix3, Quaternion, Translation3, UnitQuaternion};
use std::collections::BTreeMap;
use std::path::Path;
use tessera_geometry::Pose;

/// Columns of EuRoC up to the rotation, and of KITTI.
const EUROC_COLUMNS: usize = 8;
const KITTI_COLUMNS: usize = 12;
/// Whole stamps that differ by this are nanoseconds: as seconds they would be eleven days apart.
const LEAST_NANOS_APART: i64 = 1_000_000;
/// Columns of `trajectory_marked.txt`: those of TUM, a state and a submap.
const MARKED_COLUMNS: usize = 10;
/// States there.
const MARKS: [&str; 3] = ["tracked", "degenerate", "predicted"];

/// A trajectory as a file has it.
#[derive(Clone, Debug, PartialEq)]
pub enum TrajectoryFile {
    /// Poses with their times.
    Timed(Trajectory),
    /// KITTI has no times: one pose a row.
    Rows(Vec<Pose>),
}

impl TrajectoryFile {
    /// Two trajectories on one time axis: rows of KITTI take the times of the other one, row by row.
    ///
    /// # Errors
    /// Their numbers differ.
    pub fn together(self, other: Self) -> Result<(Trajectory, Trajectory), String> {
        let timed = |rows: Vec<Pose>, stamps: &[i64]| match rows.len() == stamps.len() {
            true => Ok(Trajectory { stamps_nanos: stamps.to_vec(), poses: rows }),
            false => Err(format!(
                "a trajectory of KITTI has no times and {} rows, the other one {} poses; expected as many",
                rows.len(),
                stamps.len()
            )),
        };
        match (self, other) {
            (Self::Timed(a), Self::Timed(b)) => Ok((a, b)),
            (Self::Timed(a), Self::Rows(rows)) => timed(rows, &a.stamps_nanos).map(|b| (a, b)),
            (Self::Rows(rows), Self::Timed(b)) => timed(rows, &b.stamps_nanos).map(|a| (a, b)),
            (Self::Rows(a), Self::Rows(b)) => {
                // Ten a second, as KITTI's cameras.
                let stamps: Vec<i64> = (0_i64..).step_by(100_000_000).take(b.len()).collect();
                Ok((timed(a, &stamps)?, timed(b, &stamps)?))
            }
        }
    }
}

/// Reads a trajectory file of any known form, told by its first row.
///
/// # Errors
/// Names the file and the line of the first thing that is wrong.
pub fn read_trajectory(path: &Path) -> Result<TrajectoryFile, ReadError> {
    let bytes = std::fs::read(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    parse_trajectory(&plain_text(&bytes), path)
}

fn parse_trajectory(text: &str, path: &Path) -> Result<TrajectoryFile, ReadError> {
    if let Some(trajectory) = nerf::parse(text, path)? {
        return Ok(TrajectoryFile::Timed(trajectory));
    }
    let is_row = |line: &&str| {
        !line.is_empty()
            && !line.starts_with('#')
            && line.starts_with(['-', '+', '.', '0', '1', '2', '3', '4', '5', '6', '7', '8', '9'])
    };
    let rows = || {
        text.lines()
            .map(|line| line.trim_start_matches('\u{feff}').trim())
            .enumerate()
            .filter(|(_, line)| is_row(line))
    };
    let Some((_, first)) = rows().next() else { return parse_tum(text, path).map(TrajectoryFile::Timed) };
    let words = words(first);
    if let Some(text) = of_largest_submap(rows().map(|(_, line)| line)) {
        return parse_tum(&text, path).map(TrajectoryFile::Timed);
    }
    if words.len() == MARKED_COLUMNS && words.last().is_some_and(|name| name.parse::<f64>().is_err()) {
        let expected = "rows with times; COLMAP's images have none: give trajectory.txt of the run";
        return Err(unusable(path, 0, first, expected));
    }
    let is_whole = is_in_nanos(text, rows().map(|(_, line)| line));
    if words.len() == KITTI_COLUMNS {
        let pose = |(at, line): (usize, &str)| {
            kitti(line).ok_or_else(|| unusable(path, at, line, "12 numbers of a 3x4 matrix"))
        };
        return Ok(TrajectoryFile::Rows(rows().map(pose).collect::<Result<_, _>>()?));
    }
    if !is_whole {
        return parse_tum(text, path).map(TrajectoryFile::Timed);
    }
    // EuRoC separates by commas and puts w first; TUM separates by spaces and puts it last.
    let is_euroc = first.contains(',');
    let mut trajectory = Trajectory::default();
    for (at, line) in rows() {
        let expected =
            if is_euroc { "nanoseconds, x, y, z, qw, qx, qy, qz" } else { "nanoseconds x y z qx qy qz qw" };
        let (stamp, pose) = nanos_row(line, is_euroc).ok_or_else(|| unusable(path, at, line, expected))?;
        trajectory.push(stamp, pose).map_err(|source| ReadError::Line {
            path: path.to_owned(),
            line: at.saturating_add(1),
            source,
        })?;
    }
    Ok(TrajectoryFile::Timed(trajectory))
}

/// Whether stamps are whole nanoseconds: as the head says, by their digits, or by how far they are apart.
fn is_in_nanos<'a>(text: &str, rows: impl Iterator<Item = &'a str>) -> bool {
    let whole = |line: &str| words(line).first()?.parse::<i64>().ok();
    let Some(stamps) = rows.map(whole).collect::<Option<Vec<i64>>>() else { return false };
    let head = text.lines().take_while(|line| line.trim_start().starts_with('#'));
    let has_digits =
        |stamp: &i64| stamp.unsigned_abs().checked_ilog10().is_some_and(|n| n as usize >= WHOLE_DIGITS - 1);
    let mut steps: Vec<i64> =
        stamps.iter().zip(stamps.iter().skip(1)).map(|(a, b)| b.saturating_sub(*a)).collect();
    steps.sort_unstable();
    stamps.first().is_some_and(has_digits)
        || head.into_iter().any(|line| line.contains("[ns]"))
        || steps.get(steps.len() / 2).is_some_and(|step| *step >= LEAST_NANOS_APART)
}

/// The rows of `trajectory_marked.txt` in the submap that has most: poses of two submaps have no common frame.
fn of_largest_submap<'a>(rows: impl Iterator<Item = &'a str>) -> Option<String> {
    let mut submaps: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for line in rows {
        let (rest, submap) = line.rsplit_once(' ')?;
        let (row, mark) = rest.rsplit_once(' ')?;
        if !MARKS.contains(&mark) {
            return None;
        }
        submaps.entry(submap).or_default().push(row);
    }
    // The first of two that have as many.
    let most = submaps.into_values().rev().max_by_key(Vec::len)?;
    Some(most.join("\n"))
}

fn unusable(path: &Path, at: usize, line: &str, expected: &'static str) -> ReadError {
    let found = line.chars().take(60).collect();
    ReadError::Row { path: path.to_owned(), line: at.saturating_add(1), found, expected }
}

fn numbers(words: &[&str]) -> Option<Vec<f64>> {
    words.iter().map(|word| word.parse().ok().filter(|number: &f64| number.is_finite())).collect()
}

fn nanos_row(line: &str, is_w_first: bool) -> Option<(i64, Pose)> {
    let words = words(line);
    let columns = words.get(..EUROC_COLUMNS).filter(|_| is_w_first || words.len() == EUROC_COLUMNS)?;
    let (stamp, columns) = columns.split_first()?;
    let stamp: i64 = stamp.parse().ok()?;
    let [x, y, z, a, b, c, d] = numbers(columns)?[..] else { return None };
    let quaternion = if is_w_first { Quaternion::new(a, b, c, d) } else { Quaternion::new(d, a, b, c) };
    let is_unit = (quaternion.norm() - 1.0).abs() <= ROTATION_TOLERANCE;
    is_unit.then(|| {
        (stamp, Pose::from_parts(Translation3::new(x, y, z), UnitQuaternion::new_normalize(quaternion)))
    })
}

fn kitti(line: &str) -> Option<Pose> {
    let [a, b, c, x, d, e, f, y, g, h, i, z] = numbers(&words(line))?[..] else { return None };
    of_matrix(Matrix3::new(a, b, c, d, e, f, g, h, i), [x, y, z])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<TrajectoryFile, String> {
        parse_trajectory(text, Path::new("a.csv")).map_err(|error| error.to_string())
    }

    #[test]
    fn one_pose_in_each_form() {
        // A quarter turn about z.
        let euroc = "#timestamp [ns], p\n1700000000033333333,1,2,3,0.70710678,0,0,0.70710678,9,9,9\n";
        let tum = "1700000000033333333 1 2 3 0 0 0.70710678 0.70710678\n";
        let seconds = "1700000000.033333333 1 2 3 0 0 0.70710678 0.70710678\n";
        let parsed = parse(seconds).unwrap();
        let TrajectoryFile::Timed(expected) = &parsed else { panic!("it has times") };
        for text in [euroc, tum] {
            let Ok(TrajectoryFile::Timed(found)) = parse(text) else { panic!("{:?}", parse(text)) };
            assert_eq!(found.stamps_nanos, [1_700_000_000_033_333_333]);
            assert!((found.poses[0].inverse() * expected.poses[0]).translation.vector.norm() < 1e-7);
            assert!(found.poses[0].rotation.angle_to(&expected.poses[0].rotation) < 1e-7);
        }
        let kitti = parse("0 -1 0 1 1 0 0 2 0 0 1 3\n").unwrap();
        let (of_kitti, timed) = kitti.together(parsed.clone()).unwrap();
        assert_eq!(of_kitti.stamps_nanos, timed.stamps_nanos);
        assert!(of_kitti.poses[0].rotation.angle_to(&timed.poses[0].rotation) < 1e-7);
        let two = parse("1 0 0 1 0 1 0 2 0 0 1 3\n1 0 0 1 0 1 0 2 0 0 1 3\n").unwrap();
        assert!(
            two.clone().together(parsed).unwrap_err().contains("no times and 2 rows, the other one 1 poses")
        );
        assert_eq!(two.clone().together(two).unwrap().0.stamps_nanos, [0, 100_000_000]);
    }

    #[test]
    fn what_an_export_writes_is_read() {
        // Of a simulated world time begins at 0.
        let stamps = |text: &str| match parse(text) {
            Ok(TrajectoryFile::Timed(found)) => found.stamps_nanos,
            other => panic!("{other:?}"),
        };
        let euroc = "#timestamp [ns],p_RS_R_x [m]\n0,1,2,3,1,0,0,0\n33333333,1,2,3,1,0,0,0\n";
        assert_eq!(stamps(euroc), [0, 33_333_333]);
        assert_eq!(stamps("0 1 2 3 0 0 0 1\n33333333 1 2 3 0 0 0 1\n"), [0, 33_333_333]);
        assert_eq!(stamps("0 1 2 3 0 0 0 1\n33 1 2 3 0 0 0 1\n"), [0, 33_000_000_000]);
        let marked = "# words\n0.5 1 2 3 0 0 0 1 tracked 0\n0.6 1 2 3 0 0 0 1 predicted 1\n0.7 1 2 3 0 0 0 1 degenerate 1\n";
        assert_eq!(stamps(marked), [600_000_000, 700_000_000]);
        let colmap = parse("1 1 0 0 0 1 2 3 1 000000.png\n").unwrap_err();
        assert!(colmap.contains("COLMAP's images have none: give trajectory.txt"), "{colmap}");
    }

    #[test]
    fn rows_that_are_none_are_named() {
        let table = [
            (
                "1 0 0 1 0 1 0 2 0 0 7 3\n",
                "a.csv, line 1: found '1 0 0 1 0 1 0 2 0 0 7 3', expected 12 numbers of a 3x4 matrix",
            ),
            ("1700000000033333333,1,2,3,0.5,0,0,0.5\n", "expected nanoseconds, x, y, z, qw, qx, qy, qz"),
            ("1700000000033333333 1 2 3 0 0 0 1 5\n", "expected nanoseconds x y z qx qy qz qw"),
            ("1 2 3\n", "found 3 columns"),
            ("words\n", "a.csv, line 1"),
            ("", "has no poses"),
        ];
        for (text, expected) in table {
            let found = parse(text).unwrap_err();
            assert!(found.contains(expected), "'{found}' lacks '{expected}'");
        }
    }
}
