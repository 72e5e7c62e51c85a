//! Trajectories in the TUM text form: one `timestamp tx ty tz qx qy qz qw` a line.

use crate::text::plain::{columns, is_whole_nanos, plain_text};
use crate::text::stamp::{StampError, format_stamp, parse_stamp};
use nalgebra::{Matrix3, Quaternion, Rotation3, Translation3, UnitQuaternion};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tessera_geometry::Pose;

/// A rotation in a file may be this far from one: files with four digits are.
pub(crate) const ROTATION_TOLERANCE: f64 = 0.02;

/// Poses over time, stamps strictly increasing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    /// Sensor times, nanoseconds, strictly increasing.
    pub stamps_nanos: Vec<i64>,
    /// `world_from_camera` at each stamp, translation in metres.
    pub poses: Vec<Pose>,
}

impl Trajectory {
    /// Number of poses.
    pub fn len(&self) -> usize {
        self.stamps_nanos.len()
    }

    /// Whether there is no pose.
    pub fn is_empty(&self) -> bool {
        self.stamps_nanos.is_empty()
    }

    /// Appends a pose, whose stamp must be above the last.
    ///
    /// # Errors
    /// The stamp is not above the last one.
    pub fn push(&mut self, stamp_nanos: i64, world_from_camera: Pose) -> Result<(), TrajectoryError> {
        match self.stamps_nanos.last() {
            Some(&before) if before == stamp_nanos => {
                Err(TrajectoryError::Repeated { found: format_stamp(stamp_nanos) })
            }
            Some(&before) if before > stamp_nanos => Err(TrajectoryError::Unsorted {
                found: format_stamp(stamp_nanos),
                before: format_stamp(before),
            }),
            _ => {
                self.stamps_nanos.push(stamp_nanos);
                self.poses.push(world_from_camera);
                Ok(())
            }
        }
    }

    /// Stamps in seconds, as the scripts see them.
    pub fn seconds(&self) -> Vec<f64> {
        self.stamps_nanos.iter().map(|&nanos| crate::stamp_seconds(nanos)).collect()
    }
}

/// What is wrong with one line of a trajectory.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TrajectoryError {
    /// A row does not have eight columns.
    #[error("found {found} columns, expected 8: timestamp tx ty tz qx qy qz qw")]
    Columns {
        /// Columns found.
        found: usize,
    },
    /// The first column is not a time.
    #[error(transparent)]
    Stamp(#[from] StampError),
    /// A column is not a finite number.
    #[error("{column} is '{found}', expected a finite number")]
    Number {
        /// Name of the column.
        column: &'static str,
        /// The word found.
        found: String,
    },
    /// The quaternion has no direction or is far from unit length.
    #[error("quaternion has length {norm:.4}, expected 1 (qx qy qz qw, w last)")]
    Quaternion {
        /// Length found.
        norm: f64,
    },
    /// A stamp comes twice.
    #[error("timestamp {found} is repeated, expected each once")]
    Repeated {
        /// The stamp, seconds.
        found: String,
    },
    /// A stamp is below the one before it.
    #[error("timestamp {found} comes after {before}, expected increasing timestamps")]
    Unsorted {
        /// The stamp, seconds.
        found: String,
        /// The one before it, seconds.
        before: String,
    },
}

/// Why a trajectory file cannot be used; names the file and the line.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A line cannot be used.
    #[error("{}, line {line}: {source}", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// What is wrong with it.
        source: TrajectoryError,
    },
    /// A row of another form than TUM's cannot be used.
    #[error("{}, line {line}: found '{found}', expected {expected}", path.display())]
    Row {
        /// The file.
        path: PathBuf,
        /// Line, counted from 1.
        line: usize,
        /// The row, as far as it is shown.
        found: String,
        /// Its columns.
        expected: &'static str,
    },
    /// There is no row.
    #[error("{} has no poses, expected lines of: timestamp tx ty tz qx qy qz qw", path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
}

/// Reads a trajectory file.
///
/// # Errors
/// Names the file and the line of the first thing that is wrong.
pub fn read_tum(path: &Path) -> Result<Trajectory, ReadError> {
    let bytes = std::fs::read(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    parse_tum(&plain_text(&bytes), path)
}

/// Reads the text of a trajectory file; `path` is for messages only.
///
/// Blank lines and lines that begin with `#` are passed over; commas, semicolons and tabs separate
/// as well as spaces do.
///
/// # Errors
/// Names the file and the line of the first thing that is wrong.
pub fn parse_tum(text: &str, path: &Path) -> Result<Trajectory, ReadError> {
    let mut trajectory = Trajectory::default();
    for (number, line) in (1..).zip(text.lines()) {
        let line_error = |source| ReadError::Line { path: path.to_owned(), line: number, source };
        let line = line.trim_start_matches('\u{feff}').trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let (stamp_nanos, pose) = parse_row(line).map_err(line_error)?;
        trajectory.push(stamp_nanos, pose).map_err(line_error)?;
    }
    if trajectory.is_empty() {
        return Err(ReadError::Empty { path: path.to_owned() });
    }
    Ok(trajectory)
}

/// Rows of a trajectory file, without those that cannot be used.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TumRows {
    /// Rows that can be used, sorted by time.
    pub trajectory: Trajectory,
    /// Rows that are left out.
    pub n_left_out: usize,
    /// The first of them: file, line and what is wrong.
    pub first_problem: Option<String>,
}

/// Reads a trajectory file as [`read_tum`] does, and leaves out rows that cannot be used: not finite, no
/// rotation, a time that repeats, another number of columns. Rows are sorted by time.
///
/// # Errors
/// The file cannot be read, or no row can be used.
pub fn read_tum_rows(path: &Path) -> Result<TumRows, ReadError> {
    let bytes = std::fs::read(path).map_err(|source| ReadError::Io { path: path.to_owned(), source })?;
    parse_tum_rows(&plain_text(&bytes), path)
}

fn parse_tum_rows(text: &str, path: &Path) -> Result<TumRows, ReadError> {
    let (mut found, mut rows, mut first_error) = (TumRows::default(), Vec::new(), None);
    let mut leave_out = |line: usize, source: TrajectoryError| {
        let error = ReadError::Line { path: path.to_owned(), line, source };
        first_error = first_error.take().or(Some(error));
        found.n_left_out = found.n_left_out.saturating_add(1);
    };
    for (number, line) in (1..).zip(text.lines()) {
        let line = line.trim_start_matches('\u{feff}').trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        match parse_row(line) {
            Ok((stamp, pose)) => rows.push((stamp, number, pose)),
            Err(source) => leave_out(number, source),
        }
    }
    // Stable: of rows with one time the first is kept.
    rows.sort_by_key(|(stamp, ..)| *stamp);
    let mut trajectory = Trajectory::default();
    for (stamp, line, pose) in rows {
        if let Err(source) = trajectory.push(stamp, pose) {
            leave_out(line, source);
        }
    }
    found.first_problem = first_error.as_ref().map(ToString::to_string);
    if trajectory.is_empty() {
        return Err(first_error.unwrap_or(ReadError::Empty { path: path.to_owned() }));
    }
    Ok(TumRows { trajectory, ..found })
}

fn parse_row(line: &str) -> Result<(i64, Pose), TrajectoryError> {
    let words = columns(line);
    let &[stamp, ref rest @ ..] = words.as_slice() else { return Err(TrajectoryError::Columns { found: 0 }) };
    // EuRoC separates by commas, counts nanoseconds and puts w first.
    let is_euroc = line.contains(',') && is_whole_nanos(stamp);
    let rest = rest.get(..7).filter(|_| is_euroc).unwrap_or(rest);
    if rest.len() != 7 {
        return Err(TrajectoryError::Columns { found: words.len() });
    }
    let stamp_nanos = parse_stamp(stamp)?;
    let mut values = [0.0; 7];
    for ((value, word), column) in values.iter_mut().zip(rest).zip(["tx", "ty", "tz", "qx", "qy", "qz", "qw"])
    {
        *value = word
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite())
            .ok_or_else(|| TrajectoryError::Number { column, found: (*word).to_owned() })?;
    }
    let [tx, ty, tz, a, b, c, d] = values;
    let [qx, qy, qz, qw] = if is_euroc { [b, c, d, a] } else { [a, b, c, d] };
    let quaternion = Quaternion::new(qw, qx, qy, qz);
    let norm = quaternion.norm();
    if !((norm - 1.0).abs() <= ROTATION_TOLERANCE) {
        return Err(TrajectoryError::Quaternion { norm });
    }
    let rotation = UnitQuaternion::new_normalize(quaternion);
    Ok((stamp_nanos, Pose::from_parts(Translation3::new(tx, ty, tz), rotation)))
}

/// Writes a trajectory: the `header`, each of its lines behind `# `, then one row a pose.
///
/// # Errors
/// What the writer says.
pub fn write_tum<'a>(
    writer: &mut dyn Write,
    header: &str,
    rows: impl IntoIterator<Item = (i64, &'a Pose)>,
) -> io::Result<()> {
    for line in header.lines() {
        writeln!(writer, "# {line}")?;
    }
    for (stamp_nanos, world_from_camera) in rows {
        write_tum_row(writer, stamp_nanos, world_from_camera)?;
    }
    Ok(())
}

/// Writes one row: stamp with six to nine digits, metres and quaternion with nine.
///
/// # Errors
/// What the writer says.
pub fn write_tum_row(writer: &mut dyn Write, stamp_nanos: i64, world_from_camera: &Pose) -> io::Result<()> {
    let t = &world_from_camera.translation.vector;
    let q = world_from_camera.rotation.quaternion();
    // Adding zero turns -0 into 0, so that "-0.000000000" is never written for identity.
    let [tx, ty, tz, qx, qy, qz, qw] = [t.x, t.y, t.z, q.i, q.j, q.k, q.w].map(|v| v + 0.0);
    let stamp = format_stamp(stamp_nanos);
    writeln!(writer, "{stamp} {tx:.9} {ty:.9} {tz:.9} {qx:.9} {qy:.9} {qz:.9} {qw:.9}")
}

/// A pose by its rotation as a matrix and its translation, metres; `None`: the matrix is no rotation.
pub(crate) fn of_matrix(rotation: Matrix3<f64>, [x, y, z]: [f64; 3]) -> Option<Pose> {
    let is_rotation = (rotation * rotation.transpose() - Matrix3::identity()).amax() <= ROTATION_TOLERANCE
        && rotation.determinant() > 0.0;
    is_rotation.then(|| {
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        Pose::from_parts(Translation3::new(x, y, z), rotation)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        parse_tum(text, Path::new("gt.txt")).unwrap_err().to_string()
    }

    #[test]
    fn rows_that_cannot_be_used_are_left_out_and_counted() {
        let good = "0 0 0 0 0 0 1";
        let text = format!(
            "# t\n3 {good}\n1 {good}\n1 {good}\n2 nan 0 0 0 0 0 1\n4 0 0 0 0 0 0 0\n5 {good} 7\n0 0 0 0 0 0 0 0\n6 {good}\n"
        );
        let rows = parse_tum_rows(&text, Path::new("gt.txt")).unwrap();
        assert_eq!(rows.trajectory.stamps_nanos, [1, 3, 6].map(|s| s * 1_000_000_000));
        assert_eq!(rows.n_left_out, 5);
        assert!(rows.first_problem.unwrap().contains("gt.txt, line 5: tx is 'nan'"));
        let none = parse_tum_rows("1 2 3\n", Path::new("gt.txt")).unwrap_err().to_string();
        assert!(none.contains("line 1: found 3 columns"), "{none}");
        assert!(matches!(parse_tum_rows("# no\n", Path::new("gt.txt")), Err(ReadError::Empty { .. })));
    }

    #[test]
    fn each_bad_line_is_named_with_what_was_found_and_expected() {
        let table = [
            ("1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1", "gt.txt, line 2: timestamp 1.000000 is repeated"),
            ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1", "line 2: timestamp 1.000000 comes after 2.000000"),
            ("# x\n\n1 0 nan 0 0 0 0 1", "line 3: ty is 'nan', expected a finite number"),
            ("1 0 0 0 0 0 0", "line 1: found 7 columns, expected 8"),
            ("1 0 0 0 0 0 0 1 9", "line 1: found 9 columns, expected 8"),
            ("1 0 0 0 0 0 0 0", "line 1: quaternion has length 0.0000, expected 1"),
            ("1 0 0 0 0 0 1 1", "quaternion has length 1.4142"),
            ("x 0 0 0 0 0 0 1", "timestamp is 'x', expected seconds"),
            ("# only a comment", "gt.txt has no poses"),
        ];
        for (text, expected) in table {
            let found = message(text);
            assert!(found.contains(expected), "'{found}' lacks '{expected}'");
        }
    }

    #[test]
    fn a_missing_file_is_named() {
        let error = read_tum(Path::new("no/such/file.txt")).unwrap_err().to_string();
        assert!(error.starts_with("no/such/file.txt: "), "{error}");
    }

    #[test]
    fn what_is_written_is_read_back() {
        let text = "1305031453.374112 1.5 -2.25 0 0.6 0 0 0.8\n1305031453.404816123,0 1 2\t0 0 0 -1\n";
        let read = parse_tum(text, Path::new("x")).unwrap();
        let mut bytes = Vec::new();
        write_tum(&mut bytes, "one\ntwo", read.stamps_nanos.iter().copied().zip(&read.poses)).unwrap();
        let written = String::from_utf8(bytes).unwrap();
        assert!(written.starts_with("# one\n# two\n1305031453.374112 1.500000000 -2.250000000 0.0"));
        assert!(!written.contains("-0.000000000"));
        assert_eq!(parse_tum(&written, Path::new("y")).unwrap(), read);
    }
}
