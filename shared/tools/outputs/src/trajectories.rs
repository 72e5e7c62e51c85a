//! `trajectory.txt`, `trajectory_online.txt` and `keyframes.txt`.

use crate::ToolError;
use crate::files::write_whole;
use crate::replay::Replay;
use std::path::Path;
use tessera_evaluation::{Trajectory, write_tum, write_tum_row};
use tessera_geometry::Pose;
use tessera_slam::State;

/// Stamps and poses, one each row.
pub(crate) type Rows = Vec<(i64, Pose)>;

const COLUMNS: &str = "world_from_camera, metres: timestamp tx ty tz qx qy qz qw";

/// Every processed frame with all corrections.
pub fn final_rows(replay: &Replay) -> Rows {
    replay.frames.iter().map(|frame| (frame.stamp_nanos, replay.final_pose(frame))).collect()
}

/// Every processed frame as it was first published.
pub(crate) fn online_rows(replay: &Replay) -> Rows {
    replay.frames.iter().map(|frame| (frame.stamp_nanos, Pose::from(&frame.world_from_camera))).collect()
}

/// Every keyframe of this run with all corrections; those of earlier runs have other clocks.
pub fn keyframe_rows(replay: &Replay) -> Rows {
    let rows = replay.keyframes.iter().map(|k| k.stamp_nanos).zip(replay.keyframe_poses());
    rows.skip(replay.n_map_keyframes).collect()
}

/// The rows as a trajectory to be evaluated; `None` where the stamps do not rise.
pub fn as_trajectory(rows: &Rows) -> Option<Trajectory> {
    let mut trajectory = Trajectory::default();
    for (stamp_nanos, pose) in rows {
        trajectory.push(*stamp_nanos, *pose).ok()?;
    }
    Some(trajectory)
}

/// Writes all three files.
pub(crate) fn write(replay: &Replay, folder: &Path) -> Result<(), ToolError> {
    let files = [
        ("trajectory.txt", "final pose of every processed frame", final_rows(replay)),
        ("trajectory_online.txt", "pose of every processed frame as first published", online_rows(replay)),
        ("keyframes.txt", "final pose of every keyframe of this run", keyframe_rows(replay)),
    ];
    for (name, what, rows) in files {
        let header = format!("{what}\n{COLUMNS}");
        write_whole(folder, name, |mut writer| {
            write_tum(&mut writer, &header, rows.iter().map(|(stamp, pose)| (*stamp, pose)))
        })?;
    }
    write_marked(replay, folder)
}

/// The final trajectory once more, with a ninth column that says which poses were measured.
fn write_marked(replay: &Replay, folder: &Path) -> Result<(), ToolError> {
    write_whole(folder, "trajectory_marked.txt", |writer| {
        writeln!(
            writer,
            "# final pose of every processed frame, and whether it was tracked or only predicted"
        )?;
        writeln!(writer, "# {COLUMNS} state")?;
        for ((stamp, pose), frame) in final_rows(replay).iter().zip(&replay.frames) {
            let mut row = Vec::new();
            write_tum_row(&mut row, *stamp, pose)?;
            let mark = if frame.state == State::Tracking { "tracked" } else { "predicted" };
            writeln!(writer, "{} {mark}", String::from_utf8_lossy(&row).trim_end())?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run;

    #[test]
    fn every_processed_frame_has_its_row() {
        let dir = tempfile::tempdir().unwrap();
        write(&test_run::replay(), dir.path()).unwrap();
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
            let (row, mark) = marked.rsplit_once(' ').unwrap();
            assert_eq!(row, plain);
            mark
        });
        let expected = ["tracked", "tracked", "tracked", "tracked", "predicted", "tracked"];
        assert_eq!(marks.collect::<Vec<_>>(), expected);
    }
}
