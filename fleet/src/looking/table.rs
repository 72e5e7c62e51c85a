//! `tessera base DIR top` on a terminal: the runs of a base as they come.

use crate::base::status::{CopyStatus, RunState, Status, bytes, rounded};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout};
use ratatui::style::{Modifier, Style};
use ratatui::widgets::{Paragraph, Row, Table};

/// Title and width of each column; they have room in 80 columns.
const COLUMNS: [(&str, u16); 8] = [
    ("robot", 10),
    ("run", 12),
    ("state", 7),
    ("frames", 7),
    ("keyframes", 9),
    ("behind", 9),
    ("a second", 9),
    ("received", 9),
];

/// Draws a status: runs, and below them what was refused and the map.
pub(super) fn draw(frame: &mut Frame<'_>, status: &Status, is_running: bool) {
    let n_runs = u16::try_from(status.runs.len()).unwrap_or(u16::MAX);
    let [top, middle, bottom] = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(n_runs.saturating_add(2)),
        Constraint::Min(3),
    ])
    .areas(frame.area());
    let title = format!("{}   (q ends the view, not the base)", status.headline(is_running));
    frame.render_widget(Paragraph::new(title), top);
    frame.render_widget(runs(status, is_running), middle);
    frame.render_widget(Paragraph::new(below(status)), bottom);
}

fn runs(status: &Status, is_running: bool) -> Table<'static> {
    // Bold alone: readable without colours, and nothing to switch off for NO_COLOR.
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let rows = status.runs.iter().map(|run| Row::new(cells(run, is_running)));
    Table::new(rows, COLUMNS.map(|(_, width)| Constraint::Length(width)))
        .header(Row::new(COLUMNS.map(|(title, _)| title)).style(bold))
}

fn cells(run: &CopyStatus, is_running: bool) -> [String; 8] {
    let state = run.state(is_running);
    let rate = if state == RunState::GoesOn { bytes(rounded(run.bytes_per_s)) } else { "-".into() };
    [
        run.robot.clone(),
        run.run.clone(),
        state.words().into(),
        run.frames.to_string(),
        run.keyframes.to_string(),
        bytes(run.lag_bytes),
        rate,
        bytes(run.received_bytes),
    ]
}

/// What stands in a run's way, and then the map.
fn below(status: &Status) -> String {
    let problem = |run: &CopyStatus| {
        let problem = run.problem.as_ref().or(run.answer_problem.as_ref())?;
        Some(format!("{} {}: {problem}\n", run.robot, run.run))
    };
    status.runs.iter().filter_map(problem).collect::<String>() + &status.below_runs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;

    fn words(line: &str) -> String {
        line.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn at_80_columns_every_run_stands_whole() {
        let run = |robot: &str, is_connected| CopyStatus {
            robot: robot.into(),
            run: "morning".into(),
            is_connected,
            frames: 12345,
            keyframes: 678,
            lag_bytes: 60_400,
            bytes_per_s: 98_200.0,
            received_bytes: 45_100_000,
            ..CopyStatus::default()
        };
        let mut runs = vec![run("robot1", true), run("robot2", false)];
        runs[1].problem = Some("the journal is not the one copied so far".into());
        let status = Status { pid: 7, runs, ..Status::default() };
        let mut terminal = Terminal::new(TestBackend::new(80, 10)).unwrap();
        terminal.draw(|frame| draw(frame, &status, true)).unwrap();
        let buffer = terminal.backend().buffer().clone();
        let line = |y: u16| (0..80).map(|x| buffer[(x, y)].symbol()).collect::<String>();
        assert!(line(0).starts_with("base: pid 7, no network   (q ends the view"), "{}", line(0));
        assert_eq!(words(&line(2)), COLUMNS.map(|(title, _)| title).join(" "));
        assert_eq!(words(&line(3)), "robot1 morning goes on 12345 678 60.4 kB 98.2 kB 45.1 MB");
        assert_eq!(words(&line(4)), "robot2 morning away 12345 678 60.4 kB - 45.1 MB");
        assert!(line(6).starts_with("robot2 morning: the journal is not the one"), "{}", line(6));
        assert!(line(7).starts_with("map: none yet"), "{}", line(7));
    }
}
