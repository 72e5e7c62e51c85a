//! `trajectory.txt` and its like: `trajectory_online.txt`, `trajectory_marked.txt`, `keyframes.txt`, and
//! `trajectory_submap_N.txt` for each submap that is apart.

use crate::ToolError;
use crate::files::write_file;
use crate::replay::Replay;
use std::collections::BTreeSet;
use std::path::Path;
use tessera_evaluation::{Trajectory, format_stamp, write_tum, write_tum_row};
use tessera_geometry::Pose;
use tessera_slam::State;

/// Stamps and poses, one each row.
pub(crate) type Rows = Vec<(i64, Pose)>;

const COLUMNS: &str = "world_from_camera, metres: timestamp tx ty tz qx qy qz qw";

/// Beginning of the name of a submap's own file.
const SUBMAP_PREFIX: &str = "trajectory_submap_";

/// Every processed frame of the main component with all corrections.
pub fn final_rows(replay: &Replay) -> Rows {
    rows_of(replay, replay.main_component())
}

fn rows_of(replay: &Replay, component: u32) -> Rows {
    let frames = replay.frames.iter().filter(|frame| replay.component(frame) == component);
    frames.map(|frame| (frame.stamp_nanos, replay.final_pose(frame))).collect()
}

/// Every processed frame as it was first published.
pub(crate) fn online_rows(replay: &Replay) -> Rows {
    replay.frames.iter().map(|frame| (frame.stamp_nanos, Pose::from(&frame.pose.world_from_camera))).collect()
}

/// Every keyframe of this run in the main component with all corrections; those of earlier runs have
/// other clocks.
pub fn keyframe_rows(replay: &Replay) -> Rows {
    let own = replay.main_keyframes().filter(|(k, _)| k.id as usize >= replay.n_map_keyframes);
    own.map(|(keyframe, pose)| (keyframe.stamp_nanos, pose)).collect()
}

/// The rows as a trajectory to be evaluated; `None` where the stamps do not rise.
pub fn as_trajectory(rows: &Rows) -> Option<Trajectory> {
    let mut trajectory = Trajectory::default();
    for (stamp_nanos, pose) in rows {
        trajectory.push(*stamp_nanos, *pose).ok()?;
    }
    Some(trajectory)
}

/// Writes all these files.
pub(crate) fn write(replay: &Replay, folder: &Path) -> Result<(), ToolError> {
    let files = [
        ("trajectory.txt", "final pose of every processed frame", final_rows(replay)),
        ("trajectory_online.txt", &online_words(replay), online_rows(replay)),
        ("keyframes.txt", "final pose of every keyframe of this run", keyframe_rows(replay)),
    ];
    for (name, what, rows) in files {
        write_rows(folder, name, what, &rows)?;
    }
    write_submaps(replay, folder)?;
    write_marked(replay, folder)
}

/// What `trajectory_online.txt` holds, with the stamps from which on another world frame holds.
fn online_words(replay: &Replay) -> String {
    let mut words = "pose of every processed frame as first published".to_owned();
    let gauges = replay.online_gauges();
    let changes =
        gauges.iter().zip(gauges.iter().zip(&replay.frames).skip(1)).filter(|(old, (new, _))| old != new);
    for (place, (_, (_, frame))) in changes.enumerate() {
        words.push_str(if place == 0 { "; in another world frame from " } else { ", " });
        words.push_str(&format_stamp(frame.stamp_nanos));
    }
    words
}

fn write_rows(folder: &Path, name: &str, what: &str, rows: &Rows) -> Result<(), ToolError> {
    let header = format!("{what}\n{COLUMNS}");
    write_file(&folder.join(name), |mut writer| {
        write_tum(&mut writer, &header, rows.iter().map(|(stamp, pose)| (*stamp, pose)))
    })
}

/// The submaps that are apart from the main one, each in its own gauge; files of earlier exports, when
/// more of them were apart, are removed.
fn write_submaps(replay: &Replay, folder: &Path) -> Result<(), ToolError> {
    let mut names = BTreeSet::new();
    for component in replay.apart().into_keys() {
        let name = format!("{SUBMAP_PREFIX}{component}.txt");
        let what = format!("final pose of every processed frame of submap {component}, in its own gauge");
        write_rows(folder, &name, &what, &rows_of(replay, component))?;
        names.insert(name);
    }
    let items = std::fs::read_dir(folder).map_err(|error| ToolError::write(folder, error))?;
    for path in items.flatten().map(|item| item.path()) {
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if name.starts_with(SUBMAP_PREFIX) && name.ends_with(".txt") && !names.contains(name) {
            std::fs::remove_file(&path).map_err(|error| ToolError::write(&path, error))?;
        }
    }
    Ok(())
}

/// The final poses once more, with a ninth column that says which were measured, wholly or but for a
/// degenerate direction, and a tenth with the submap: poses of one submap alone have a common frame.
fn write_marked(replay: &Replay, folder: &Path) -> Result<(), ToolError> {
    write_file(&folder.join("trajectory_marked.txt"), |writer| {
        writeln!(
            writer,
            "# final pose of every processed frame, whether it was tracked, tracked but for a degenerate \
             direction, or only predicted, and its submap"
        )?;
        writeln!(writer, "# {COLUMNS} state submap")?;
        for frame in &replay.frames {
            let mut row = Vec::new();
            write_tum_row(&mut row, frame.stamp_nanos, &replay.final_pose(frame))?;
            let mark = match frame.state {
                State::Tracking if frame.is_degenerate() => "degenerate",
                State::Tracking => "tracked",
                State::Lost | State::Relocalising => "predicted",
            };
            let (row, submap) = (String::from_utf8_lossy(&row), replay.component(frame));
            writeln!(writer, "{} {mark} {submap}", row.trim_end())?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run;
    use tessera_slam::{AlignRecord, Cause};

    #[test]
    fn every_processed_frame_has_its_row() {
        let dir = tempfile::tempdir().unwrap();
        let mut replay = test_run::replay();
        replay.frames[2].causes = vec![Cause::Degenerate(Vec::new())];
        write(&replay, dir.path()).unwrap();
        let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
        let online = read("trajectory_online.txt");
        let mut lines = online.lines();
        assert_eq!(lines.next(), Some("# pose of every processed frame as first published"));
        assert_eq!(lines.next(), Some("# world_from_camera, metres: timestamp tx ty tz qx qy qz qw"));
        assert_eq!(lines.clone().count(), 6);
        assert!(lines.nth(2).unwrap().ends_with(
            "0.200000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 1.000000000"
        ));
        assert!(read("trajectory.txt").lines().nth(4).unwrap().contains(" 1.200000000 "));
        assert_eq!(read("keyframes.txt").lines().count(), 5);
        let (marked, plain) = (read("trajectory_marked.txt"), read("trajectory.txt"));
        let marks = marked.lines().skip(2).zip(plain.lines().skip(2)).map(|(marked, plain)| {
            let (row, mark) = marked.strip_suffix(" 0").unwrap().rsplit_once(' ').unwrap();
            assert_eq!(row, plain);
            mark
        });
        let expected = ["tracked", "tracked", "degenerate", "tracked", "predicted", "tracked"];
        assert_eq!(marks.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn submaps_that_are_apart_have_files_of_their_own_until_they_are_joined() {
        let dir = tempfile::tempdir().unwrap();
        let read = |name: &str| std::fs::read_to_string(dir.path().join(name)).unwrap();
        let of = |text: &str| text.lines().filter(|line| !line.starts_with('#')).count();
        let mut apart = Replay::default();
        for mut record in test_run::records() {
            if let AlignRecord::Frame(frame) = &mut record {
                frame.submap = u32::from(frame.index == 5);
            }
            apart.apply(record);
        }
        write(&apart, dir.path()).unwrap();
        assert_eq!((of(&read("trajectory.txt")), of(&read("trajectory_submap_1.txt"))), (5, 1));
        assert_eq!((of(&read("keyframes.txt")), apart.main_keyframes().count()), (2, 2));
        assert_eq!((of(&read("trajectory_marked.txt")), of(&read("trajectory_online.txt"))), (6, 6));
        assert!(read("trajectory_marked.txt").lines().last().unwrap().ends_with(" tracked 1"));
        let online = read("trajectory_online.txt");
        let words = online.lines().next().unwrap();
        assert!(words.ends_with("as first published; in another world frame from 100.166665"), "{words}");
        write(&test_run::replay(), dir.path()).unwrap();
        assert!(!dir.path().join("trajectory_submap_1.txt").exists());
    }
}
