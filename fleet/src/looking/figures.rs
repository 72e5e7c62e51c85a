//! The status of a base as Prometheus reads it.

use crate::base::status::{CopyStatus, RunState, Status};
use crate::map::summary::JoinVerdict;
use tessera_report::Exposition;

/// Reads one figure of a run.
type BaseFigure = fn(&CopyStatus) -> f64;

/// Name, kind, meaning, and where the figure stands.
const FIGURES: [(&str, &str, &str, BaseFigure); 9] = [
    ("tessera_fleet_frames", "gauge", "Frames of the run at the base.", |run| run.frames as f64),
    ("tessera_fleet_keyframes", "gauge", "Keyframes of the run at the base.", |run| run.keyframes as f64),
    ("tessera_fleet_surfaces", "gauge", "Surfaces of keyframes at the base.", |run| run.surfaces as f64),
    ("tessera_fleet_surfaces_waiting", "gauge", "Surfaces that the map lacks.", |run| {
        run.surfaces_waiting as f64
    }),
    ("tessera_fleet_bytes", "gauge", "Bytes of the run at the base.", |run| run.bytes as f64),
    ("tessera_fleet_behind_bytes", "gauge", "Bytes that the robot alone has.", |run| run.lag_bytes as f64),
    ("tessera_fleet_received_bytes_total", "counter", "Bytes that came since the base started.", |run| {
        run.received_bytes as f64
    }),
    ("tessera_fleet_corrections_total", "counter", "Corrections that came from the base.", |run| {
        run.corrections_from_base as f64
    }),
    ("tessera_fleet_has_problem", "gauge", "1 where the copy does not go on.", |run| {
        f64::from(run.problem.is_some())
    }),
];

/// All figures of a base.
pub(super) fn figures(status: &Status, is_running: bool) -> Exposition {
    let mut figures = Exposition::default();
    figures.family("tessera_fleet_up", "gauge", "1 while the base runs.");
    figures.sample("tessera_fleet_up", &[], f64::from(is_running));
    for (name, kind, meaning, figure) in FIGURES {
        figures.family(name, kind, meaning);
        for run in &status.runs {
            figures.sample(name, &[("robot", &run.robot), ("run", &run.run)], figure(run));
        }
    }
    const IN_STATE: &str = "tessera_fleet_runs";
    figures.family(IN_STATE, "gauge", "Runs that go on, that are away, that have ended.");
    for state in [RunState::GoesOn, RunState::Away, RunState::Ended] {
        let n = status.runs.iter().filter(|run| run.state(is_running) == state).count();
        figures.sample(IN_STATE, &[("state", state.words())], n as f64);
    }
    const REFUSED: &str = "tessera_fleet_refused_total";
    figures.family(REFUSED, "counter", "Refused since the base started.");
    for refused in &status.refused {
        figures.sample(
            REFUSED,
            &[("robot", &refused.robot), ("what", refused.what.words())],
            refused.n as f64,
        );
    }
    map_figures(&mut figures, status);
    figures
}

fn map_figures(figures: &mut Exposition, status: &Status) {
    let mut gauge = |name: &str, meaning: &str, value: f64| {
        figures.family(name, "gauge", meaning);
        figures.sample(name, &[], value);
    };
    gauge("tessera_fleet_map", "Number of the last map.", status.mapped as f64);
    gauge(
        "tessera_fleet_map_failed",
        "1 where no map could be made.",
        f64::from(status.map_problem.is_some()),
    );
    let Some(map) = &status.map else { return };
    let joined = |verdict| map.joins.iter().filter(|join| join.verdict == verdict).count() as f64;
    let keyframes: u64 = map.components.iter().map(|component| component.keyframes).sum();
    gauge("tessera_fleet_map_components", "Maps that are apart.", map.components.len() as f64);
    gauge("tessera_fleet_map_keyframes", "Keyframes in all of them.", keyframes as f64);
    gauge("tessera_fleet_joins", "Joins that hold.", joined(JoinVerdict::Held));
    gauge(
        "tessera_fleet_joins_refuted",
        "Joins that the optimisation refuted.",
        joined(JoinVerdict::Refuted),
    );
    gauge("tessera_fleet_loops", "Loops between runs that hold.", map.loops_between_runs_closed as f64);
    if let Some(cost) = status.map_cost {
        gauge("tessera_fleet_map_seconds", "Time that the map took.", cost.all_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::status::RefusedStatus;
    use crate::map::summary::{ComponentSummary, JointSummary};
    use crate::wire::request::PieceRefusal;

    #[test]
    fn every_run_and_the_map_have_their_figures() {
        let run = |robot: &str, is_connected| CopyStatus {
            robot: robot.into(),
            run: "one".into(),
            is_connected,
            frames: 60,
            received_bytes: 1234,
            ..CopyStatus::default()
        };
        let component = ComponentSummary { keyframes: 7, ..ComponentSummary::default() };
        let refused =
            RefusedStatus { robot: "x\"".into(), what: PieceRefusal::Name, n: 3, last: String::new() };
        let status = Status {
            runs: vec![run("a", true), run("b", false)],
            refused: vec![refused],
            mapped: 2,
            map: Some(JointSummary { components: vec![component], ..JointSummary::default() }),
            ..Status::default()
        };
        let text = figures(&status, true).text().to_owned();
        for line in [
            "tessera_fleet_up 1",
            "tessera_fleet_frames{robot=\"a\",run=\"one\"} 60",
            "tessera_fleet_received_bytes_total{robot=\"b\",run=\"one\"} 1234",
            "tessera_fleet_runs{state=\"goes on\"} 1",
            "tessera_fleet_runs{state=\"away\"} 1",
            "tessera_fleet_map 2",
            "tessera_fleet_map_keyframes 7",
        ] {
            assert!(text.lines().any(|other| other == line), "{line} is missing in\n{text}");
        }
        assert!(text.contains("tessera_fleet_refused_total{robot=\"x\\\"\",what="), "{text}");
        let stopped = figures(&status, false).text().to_owned();
        assert!(stopped.contains("tessera_fleet_up 0") && stopped.contains("{state=\"away\"} 2"));
    }
}
