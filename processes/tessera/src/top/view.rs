//! One look at a run on a terminal.

use super::snapshot::{Snapshot, StageLine};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Modifier, Style};
use ratatui::text::Line;
use ratatui::widgets::{Paragraph, Row, Table};

/// Title and width of each column.
const COLUMNS: [(&str, u16); 13] = [
    ("stage", 11),
    ("pid", 8),
    ("state", 20),
    ("frames", 7),
    ("1/s", 6),
    ("queue", 5),
    ("p50 ms", 7),
    ("p99 ms", 7),
    ("max ms", 7),
    ("CPU %", 6),
    ("MB", 6),
    ("drops", 6),
    ("restarts", 8),
];
/// Columns of a terminal that shows all of them.
const WIDE: u16 = 116;
/// Those of a terminal of 80 columns, and how wide they are there.
const NARROW: [(usize, u16); 10] =
    [(0, 11), (2, 14), (3, 6), (4, 5), (5, 5), (6, 6), (7, 6), (9, 5), (11, 5), (12, 8)];
const STEPS_HEADER: [&str; 7] = ["stage", "phase or step", "frames", "mean ms", "p50 ms", "p99 ms", "max ms"];
const STEPS_WIDTHS: [u16; 7] = [11, 14, 8, 8, 8, 8, 8];

/// Draws a snapshot: the stages, the last pose, and below them where the time goes.
pub(crate) fn draw(frame: &mut Frame<'_>, snapshot: &Snapshot) {
    let areas = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(snapshot.stages.len() as u16 + 2),
        Constraint::Length(2),
        Constraint::Min(0),
    ])
    .split(frame.area());
    let workload = match snapshot.workload {
        0 => String::new(),
        level => format!(", workload -{level}"),
    };
    let title = format!(
        "{}: {} keyframes, {} loops{workload}   (q ends the view, not the run)",
        snapshot.name, snapshot.keyframes, snapshot.loops
    );
    frame.render_widget(Paragraph::new(title), areas[0]);
    frame.render_widget(stages(snapshot, frame.area().width), areas[1]);
    frame.render_widget(Paragraph::new(pose(snapshot)), areas[2]);
    let rows = snapshot.stages.iter().flat_map(|stage| {
        stage.times_ms.iter().map(|(name, t)| {
            let ms = [t.mean, t.p50, t.p99, t.max].map(|ms| format!("{ms:.3}"));
            let first = [stage.stage.to_owned(), (*name).to_owned(), t.n.to_string()];
            Row::new(first.into_iter().chain(ms))
        })
    });
    frame.render_widget(table(rows, &STEPS_HEADER, &STEPS_WIDTHS), areas[3]);
}

/// The stages, in the columns that there is room for.
fn stages(snapshot: &Snapshot, width: u16) -> Table<'static> {
    let columns: Vec<(usize, u16)> = match width >= WIDE {
        true => COLUMNS.iter().enumerate().map(|(at, (_, width))| (at, *width)).collect(),
        false => NARROW.to_vec(),
    };
    let header: Vec<&str> = columns.iter().map(|(at, _)| COLUMNS[*at].0).collect();
    let widths: Vec<u16> = columns.iter().map(|(_, width)| *width).collect();
    let rows = snapshot.stages.iter().map(|stage| {
        let cells = cells(stage);
        Row::new(columns.iter().map(|(at, _)| cells[*at].clone()).collect::<Vec<_>>())
    });
    table(rows, &header, &widths)
}

fn table<'a>(rows: impl Iterator<Item = Row<'a>>, header: &[&'a str], widths: &[u16]) -> Table<'a> {
    // Bold alone: readable without colours, and nothing to switch off for NO_COLOR.
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let widths = widths.iter().map(|width| Constraint::Length(*width));
    Table::new(rows, widths).header(Row::new(header.iter().copied()).style(bold))
}

fn cells(stage: &StageLine) -> [String; 13] {
    let latency = stage.latency_ms;
    [
        stage.stage.to_owned(),
        stage.pid.map_or("-".to_owned(), |pid| pid.to_string()),
        stage.state.clone(),
        stage.frames.to_string(),
        format!("{:.1}", stage.frames_per_s),
        stage.queue.to_string(),
        format!("{:.2}", latency.p50),
        format!("{:.2}", latency.p99),
        format!("{:.2}", latency.max),
        format!("{:.1}", stage.cpu_percent),
        format!("{:.1}", stage.peak_rss_mb),
        (stage.dropped + stage.lost).to_string(),
        stage.restarts.to_string(),
    ]
}

fn pose(snapshot: &Snapshot) -> Line<'static> {
    let Some(pose) = &snapshot.pose else { return Line::from("no pose yet") };
    let [x, y, z] = pose.translation_m;
    let latency = pose.latency_ms.map_or(String::new(), |ms| format!(", {ms:.2} ms after the frame"));
    Line::from(format!("frame {}: {}, at {x:.3} {y:.3} {z:.3} m{latency}", pose.frame, pose.state))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::top::snapshot::LastPose;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use std::collections::BTreeMap;
    use tessera_lab::profile::Times;
    use tessera_outputs::LatencyMs;

    fn snapshot() -> Snapshot {
        let line = StageLine {
            stage: "align",
            pid: Some(4711),
            state: "waiting: surfaces".into(),
            frames: 123,
            frames_per_s: 29.94,
            queue: 3,
            latency_ms: LatencyMs { p50: 1.25, p99: 7.5, max: 31.125 },
            cpu_percent: 41.24,
            peak_rss_mb: 25.3,
            dropped: 4,
            lost: 1,
            restarts: 2,
            times_ms: BTreeMap::from([("search", Times::default())]),
            ..StageLine::default()
        };
        Snapshot {
            name: "room-1".into(),
            keyframes: 17,
            loops: 6,
            workload: 2,
            pose: Some(LastPose {
                frame: 122,
                state: "tracking",
                translation_m: [1.0, -2.0, 0.5],
                rotation_xyzw: [0.0, 0.0, 0.0, 1.0],
                latency_ms: Some(2.5),
            }),
            stages: vec![line],
            ..Snapshot::default()
        }
    }

    fn lines(width: u16) -> Vec<String> {
        let mut terminal = Terminal::new(TestBackend::new(width, 12)).unwrap();
        terminal.draw(|frame| draw(frame, &snapshot())).unwrap();
        let buffer = terminal.backend().buffer().clone();
        (0..12)
            .map(|y| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>().trim_end().to_owned())
            .collect()
    }

    fn words(line: &str) -> String {
        line.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn at_80_columns_what_matters_stands_whole() {
        let lines = lines(80);
        assert!(lines[0].ends_with("(q ends the view, not the run)"), "{lines:?}");
        assert_eq!(words(&lines[2]), "stage state frames 1/s queue p50 ms p99 ms CPU % drops restarts");
        assert_eq!(words(&lines[3]), "align waiting: surfa 123 29.9 3 1.25 7.50 41.2 5 2");
        assert!(words(&lines[7]).ends_with("max ms"), "{lines:?}");
    }

    #[test]
    fn everything_stands_on_a_wide_screen() {
        let lines = lines(120);
        assert!(lines[0].starts_with("room-1: 17 keyframes, 6 loops, workload -2 "), "{lines:?}");
        assert_eq!(words(&lines[2]), COLUMNS.map(|(title, _)| title).join(" "));
        assert_eq!(words(&lines[3]), "align 4711 waiting: surfaces 123 29.9 3 1.25 7.50 31.12 41.2 25.3 5 2");
        assert_eq!(lines[5], "frame 122: tracking, at 1.000 -2.000 0.500 m, 2.50 ms after the frame");
        assert!(words(&lines[8]).starts_with("align search 0 0.000"), "{lines:?}");
    }
}
