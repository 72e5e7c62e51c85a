//! `report.html` in the base's folder: what it has made of which robots, as one page that needs nothing else.

use crate::base::status::Status;
use crate::base::traffic::Traffic;
use crate::map::joint::{component_file, map_folder};
use crate::map::scene::SCENE_FILE;
use crate::map::summary::{JoinVerdict, JointSummary};
use std::path::Path;
use tessera_evaluation::read_tum;
use tessera_outputs::html::{self, escaped};
use tessera_report::{Chart, ChartForm, GREY, Series, cycled, whole_page};

/// Its name.
pub const REPORT_FILE: &str = "report.html";
/// Points of a way that are drawn: more cannot be seen.
const MOST_POINTS: usize = 1000;

/// Below the lines over time.
const SINCE: &str = "since the base started, s";
const TRAFFIC_HEAD: [&str; 4] = ["robot", "MB received", "kB/s while in contact", "in contact"];

/// The way of a run in one of the maps, seen from above in the axes of the map's first camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunWay {
    /// The run.
    pub label: String,
    /// Which map: 0 is the largest.
    pub component: usize,
    /// To the right and forward, metres.
    pub points_m: Vec<[f64; 2]>,
}

/// The page of a base, with the ways that stand in its folder.
pub fn page_of(base: &Path, status: &Status, traffic: &Traffic) -> String {
    let ways = status.map.as_ref().map_or(Vec::new(), |map| ways(&map_folder(base), map));
    // A base of another version has none.
    let scene = std::fs::read_to_string(map_folder(base).join(SCENE_FILE)).unwrap_or_default();
    page(status, traffic, &ways, &scene)
}

/// The ways of all runs in a map's folder.
fn ways(folder: &Path, map: &JointSummary) -> Vec<RunWay> {
    let mut ways = Vec::new();
    for run in &map.runs {
        for component in run.frames_by_component.keys() {
            let place = map.components.iter().position(|known| known.component == *component);
            let Some(place) = place else { continue };
            let name = component_file(&format!("trajectory_{}", run.label), place, "txt");
            // A map that takes the place of this one right now is drawn next time.
            let Ok(trajectory) = read_tum(&folder.join(name)) else { continue };
            let step = trajectory.poses.len().div_ceil(MOST_POINTS).max(1);
            let points = trajectory.poses.iter().step_by(step).map(|pose| pose.translation.vector);
            let points_m = points.map(|p| [p.x, p.z]).collect();
            ways.push(RunWay { label: run.label.clone(), component: place, points_m });
        }
    }
    ways
}

/// The page: a pure function of what it shows.
pub fn page(status: &Status, traffic: &Traffic, ways: &[RunWay], scene: &str) -> String {
    let empty = JointSummary::default();
    let map = status.map.as_ref().unwrap_or(&empty);
    let robots = robots(status);
    let (n_robots, n_runs) = (robots.len(), status.runs.len());
    let n_refuted = map.joins.iter().filter(|join| join.verdict == JoinVerdict::Refuted).count();
    let facts = [
        ("Map", status.mapped.to_string()),
        ("Maps apart", map.components.len().to_string()),
        ("Keyframes", map.components.iter().map(|c| c.keyframes).sum::<u64>().to_string()),
        ("Joins that hold, refuted", format!("{}, {n_refuted}", map.joins.len().saturating_sub(n_refuted))),
        ("Loops between runs that hold", {
            format!("{} of {}", map.loops_between_runs_closed, map.loops_between_runs)
        }),
    ];
    let facts = facts.map(|(name, value)| format!("<div><dt>{name}</dt><dd>{}</dd></div>", escaped(&value)));
    let facts = facts.concat();
    let sections = [
        ("facts", "Summary", format!("<dl>{facts}</dl>")),
        ("scene", "Map and robots in 3D", scene.to_owned()),
        ("maps", "Maps from above", maps(map, &robots, ways)),
        ("joins", "Joins", joins(map)),
        ("runs", "Runs", runs(status, map)),
        ("traffic", "Traffic", traffic_section(&robots, traffic)),
        ("refused", "Refused", refused(status)),
    ];
    let sections: String = sections
        .iter()
        .filter(|(_, _, body)| !body.is_empty())
        .map(|(id, title, body)| format!("<section id=\"{id}\"><h3>{title}</h3>{body}</section>"))
        .collect();
    let title = format!("{n_robots} robot(s), {n_runs} run(s)");
    whole_page(&title, &format!("<header><h1>{title}</h1></header>{sections}"))
}

/// Robots in the order in which they came.
fn robots(status: &Status) -> Vec<&str> {
    let mut robots: Vec<&str> = Vec::new();
    for run in &status.runs {
        if !robots.contains(&run.robot.as_str()) {
            robots.push(&run.robot);
        }
    }
    robots
}

fn maps(map: &JointSummary, robots: &[&str], ways: &[RunWay]) -> String {
    let robot_of = |label: &str| map.runs.iter().find(|run| run.label == label).map(|run| run.robot.as_str());
    let number_of =
        |label: &str| robot_of(label).and_then(|robot| robots.iter().position(|known| *known == robot));
    let mut out = String::new();
    for (place, component) in map.components.iter().enumerate() {
        let own = ways.iter().filter(|way| way.component == place);
        let mut series: Vec<Series> = own
            .map(|way| {
                let points = way.points_m.iter().map(|p| (p[0], p[1])).collect();
                of_robot(number_of(&way.label).unwrap_or(0), &way.label, points, ChartForm::Line)
            })
            .collect();
        let joins = map.joins.iter().filter(|join| join.component == Some(component.component));
        let joins = joins.filter_map(|join| Some([join.at_m?, join.with_at_m?].map(|p| (p[0], p[2]))));
        let points: Vec<(f64, f64)> = joins.flatten().collect();
        if !points.is_empty() {
            let name = format!("joins that hold ({})", points.len() / 2);
            let of_joins = |name, points, size, form| Series { name, colour: GREY, points, size, form };
            // Both ends: a join is short beside a way.
            series.push(of_joins(String::new(), points.clone(), 2.0, ChartForm::Segments));
            series.push(of_joins(name, points, 4.0, ChartForm::Dots));
        }
        let what = format!("{}: {} keyframes", component.map, component.keyframes);
        let heading = format!("<h4>{}</h4>", escaped(&what));
        let (x_label, y_label) = ("right, m".into(), "forward, m".into());
        let chart = Chart { what, x_label, y_label, series, is_map: true, ..Chart::default() };
        out.push_str(&format!("{heading}{}", drawn(&chart)));
    }
    if out.is_empty() { "<p class=\"note\">None yet.</p>".into() } else { out }
}

/// What is known of the robot that came as number `place`, in its colour.
fn of_robot(place: usize, name: &str, points: Vec<(f64, f64)>, form: ChartForm) -> Series {
    let size = if form == ChartForm::Segments { 8.0 } else { 1.6 };
    let colour = cycled(place);
    Series { name: name.to_owned(), colour, points, size, form }
}

fn drawn(chart: &Chart) -> String {
    chart.html().unwrap_or_else(|error| format!("<p class=\"note\">{}</p>", escaped(&error.to_string())))
}

fn joins(map: &JointSummary) -> String {
    let row = |join: &crate::map::summary::JoinSummary| {
        vec![
            format!("{} to {}", join.run, join.with),
            join.verdict.words().into(),
            join.keyframes_agree.to_string(),
            format!("{:.0} %", 100.0 * join.overlap),
            format!("{:.1} %", 100.0 * join.in_front),
        ]
    };
    let head = ["runs", "verdict", "keyframes agree", "overlap", "in front"];
    table("numbers second", &head, map.joins.iter().map(row).collect())
}

fn runs(status: &Status, map: &JointSummary) -> String {
    let row = |run: &crate::base::status::CopyStatus| {
        let in_map = map.runs.iter().find(|known| known.robot == run.robot && known.run == run.run);
        let state = run.state(true).words();
        let left_out = in_map.and_then(|run| run.left_out.clone()).map(|why| format!("left out: {why}"));
        let words = [Some(state.to_owned()), left_out, run.problem.clone()];
        vec![
            format!("{} {}", run.robot, run.run),
            words.into_iter().flatten().collect::<Vec<_>>().join("; "),
            run.frames.to_string(),
            run.keyframes.to_string(),
            format!("{:.1}", run.received_bytes as f64 / 1e6),
            format!("{:.1}", run.lag_bytes as f64 / 1e6),
        ]
    };
    let head = ["run", "state", "frames", "keyframes", "MB received", "MB behind"];
    table("numbers second", &head, status.runs.iter().map(row).collect())
}

fn traffic_section(robots: &[&str], traffic: &Traffic) -> String {
    if traffic.last_s() <= 0.0 {
        return String::new();
    }
    let rates = |(place, robot): (usize, &&str)| {
        let points = traffic.rates(robot).into_iter().map(|(at_s, rate)| (at_s, rate / 1e3)).collect();
        of_robot(place, robot, points, ChartForm::Line)
    };
    let contacts = |(place, robot): (usize, &&str)| {
        let at = |(from, to): (f64, f64)| [from, to].map(|at_s| (at_s, place as f64 + 1.0));
        let spans = traffic.spans(robot).into_iter().flat_map(at).collect();
        of_robot(place, &format!("{}: {robot}", place.saturating_add(1)), spans, ChartForm::Segments)
    };
    let over_time = |what: &str, y_label: &str, series: Vec<Series>| {
        let (what, x_label, y_label) = (what.into(), SINCE.into(), y_label.into());
        drawn(&Chart { what, x_label, y_label, series, from_zero: true, ..Chart::default() })
    };
    let of_robots =
        table("numbers", &TRAFFIC_HEAD, robots.iter().map(|robot| totals(robot, traffic)).collect());
    format!(
        "{of_robots}<h4>Received</h4>{}<h4>In contact</h4>{}",
        over_time("received from each robot", "kB/s", robots.iter().enumerate().map(rates).collect()),
        over_time("contact with each robot", "robot", robots.iter().enumerate().map(contacts).collect())
    )
}

/// All that came from a robot.
fn totals(robot: &str, traffic: &Traffic) -> Vec<String> {
    let contact_s: f64 = traffic.spans(robot).iter().map(|(from, to)| to - from).sum();
    let bytes = traffic.received_bytes(robot) as f64;
    let mean = if contact_s > 0.0 { format!("{:.1}", bytes / contact_s / 1e3) } else { "-".into() };
    let share = 100.0 * contact_s / traffic.last_s();
    vec![robot.to_owned(), format!("{:.2}", bytes / 1e6), mean, format!("{share:.0} %")]
}

fn refused(status: &Status) -> String {
    let row = |refused: &crate::base::status::RefusedStatus| {
        vec![
            format!("{}: {}", refused.robot, refused.what.words()),
            refused.last.clone(),
            refused.n.to_string(),
        ]
    };
    table("numbers second", &["what", "last words", "times"], status.refused.iter().map(row).collect())
}

/// A table with a head; nothing without rows.
fn table(class: &str, head: &[&str], rows: Vec<Vec<String>>) -> String {
    if rows.is_empty() { String::new() } else { html::table(class, head, &rows) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::status::CopyStatus;
    use crate::map::summary::{ComponentSummary, JoinSummary, RunSummary};

    fn status() -> Status {
        let run = |robot: &str| CopyStatus {
            robot: robot.into(),
            run: "one".into(),
            problem: Some("<script>alert(1)</script>".into()),
            ..CopyStatus::default()
        };
        let in_map = |robot: &str| RunSummary {
            robot: robot.into(),
            run: "one".into(),
            label: format!("{robot}_one"),
            ..RunSummary::default()
        };
        let component =
            ComponentSummary { keyframes: 7, map: "map.ply".into(), ..ComponentSummary::default() };
        let join = JoinSummary {
            run: "b_one".into(),
            with: "a_one".into(),
            keyframe: 4,
            with_keyframe: 2,
            component: Some(0),
            at_m: Some([1.0, 0.0, 2.0]),
            with_at_m: Some([1.5, 0.0, 2.0]),
            keyframes_agree: 3,
            overlap: 0.5,
            in_front: 0.01,
            verdict: JoinVerdict::Held,
        };
        let refuted =
            JoinSummary { component: None, at_m: None, verdict: JoinVerdict::Refuted, ..join.clone() };
        let map = JointSummary {
            runs: vec![in_map("a"), in_map("b")],
            components: vec![component],
            joins: vec![join, refuted],
            ..JointSummary::default()
        };
        Status { runs: vec![run("a"), run("b")], map: Some(map), mapped: 3, ..Status::default() }
    }

    #[test]
    fn a_page_has_every_robot_and_join_and_nothing_from_elsewhere() {
        let status = status();
        let way = |label: &str| RunWay {
            label: label.into(),
            component: 0,
            points_m: vec![[0.0, 0.0], [1.0, 2.0], [f64::NAN, 1.0]],
        };
        let mut traffic = Traffic::default();
        for second in 0..4 {
            traffic.note(f64::from(second), &status.runs);
        }
        let page = page(&status, &traffic, &[way("a_one"), way("b_one")], "");
        for id in ["facts", "maps", "joins", "runs", "traffic"] {
            assert_eq!(page.matches(&format!("<section id=\"{id}\">")).count(), 1, "{id}");
        }
        assert!(!page.contains("<section id=\"refused\">"), "nothing was refused");
        assert!(page.contains("</i>a_one</span>") && page.contains("</i>b_one</span>"));
        assert!(page.contains("</i>joins that hold (1)</span>"));
        assert!(page.contains("refuted by the optimisation"));
        assert!(page.contains("&lt;script&gt;") && !page.contains("<script"));
        let names = "http://www.w3.org/2000/svg";
        assert!(!page.replace(names, "").contains("http") && !page.contains("url(") && !page.contains("NaN"));
        // Every robot has a colour of its own.
        for words in ["right, m", "forward, m", "kB/s", "since the base started, s", "while in contact"] {
            assert!(page.contains(words), "{words}");
        }
        assert!(page.contains("background:rgb(0,114,178)") && page.contains("background:rgb(213,94,0)"));
    }

    #[test]
    fn a_base_without_a_run_has_a_page() {
        let page = page(&Status::default(), &Traffic::default(), &[], "");
        assert!(page.contains("0 robot(s)") && page.contains("None yet.") && page.ends_with("</html>\n"));
    }
}
