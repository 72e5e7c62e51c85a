//! `states.csv`: what can be said of each frame.

use crate::ToolError;
use crate::files::write_file;
use crate::replay::Replay;
use std::io::{self, Write};
use std::path::Path;
use tessera_evaluation::format_stamp;
use tessera_slam::{FrameRecord, PoseRecord, SkippedFrames, State};

const HEADER: &str = "frame,timestamp,state,reason,keyframe,correspondences,\
                      std_x_m,std_y_m,std_z_m,std_rx_rad,std_ry_rad,std_rz_rad";

/// Positions of the diagonal in the upper triangle of a 6x6 matrix, row by row.
const DIAGONAL: [usize; 6] = [0, 6, 11, 15, 18, 20];

/// Writes the file, frames that were left out among the others.
pub(crate) fn write(replay: &Replay, folder: &Path) -> Result<(), ToolError> {
    write_file(&folder.join("states.csv"), |writer| {
        writeln!(writer, "{HEADER}")?;
        let mut skipped = replay.skipped.iter().peekable();
        for frame in &replay.frames {
            while let Some(before) = skipped.next_if(|skipped| skipped.frames.start < frame.index) {
                write_skipped(writer, before)?;
            }
            write_frame(writer, frame)?;
        }
        skipped.try_for_each(|skipped| write_skipped(writer, skipped))
    })
}

fn write_skipped(writer: &mut dyn Write, skipped: &SkippedFrames) -> io::Result<()> {
    let reason = quoted(&skipped.reason);
    skipped.listed().try_for_each(|index| writeln!(writer, "{index},,dropped,{reason},,,,,,,,"))
}

fn write_frame(writer: &mut dyn Write, frame: &FrameRecord) -> io::Result<()> {
    let state = match frame.state {
        State::Tracking => "tracking",
        State::Lost => "lost",
        State::Relocalising => "relocalising",
    };
    let (stamp, reason) = (format_stamp(frame.stamp_nanos), quoted(&frame.reason()));
    let FrameRecord { index, pose: PoseRecord { keyframe, n_correspondences, .. }, .. } = frame;
    write!(writer, "{index},{stamp},{state},{reason},{keyframe},{n_correspondences}")?;
    for position in DIAGONAL {
        match frame.pose.covariance.get(position) {
            Some(variance) => write!(writer, ",{:.6e}", variance.max(0.0).sqrt())?,
            None => write!(writer, ",")?,
        }
    }
    writeln!(writer)
}

/// A field as CSV wants it.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run;

    #[test]
    fn each_frame_has_its_line_and_no_frame_is_missing() {
        let dir = tempfile::tempdir().unwrap();
        write(&test_run::replay(), dir.path()).unwrap();
        let text = std::fs::read_to_string(dir.path().join("states.csv")).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 8);
        assert!(lines[0].starts_with("frame,timestamp,state,reason"));
        assert!(lines[1].starts_with("0,100.000000,tracking,,0,0,,"), "{}", lines[1]);
        let expected = "4,100.133332,lost,\"0.6 % of the queries have a match, at least 15.0 % are needed\",1,12,1.000000e-2,";
        assert!(lines[5].starts_with(expected), "{}", lines[5]);
        assert!(lines[5].ends_with(",6.000000e-2"), "{}", lines[5]);
        assert_eq!(lines[7], "6,,dropped,newer frames had come,,,,,,,,");
        let columns = lines[0].split(',').count();
        assert_eq!(lines[1].split(',').count(), columns);
        assert_eq!(lines[7].split(',').count(), columns);
    }
}
