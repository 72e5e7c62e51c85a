//! The sections of one run, in their order.

use crate::run::{FrameState, ReportedRun};
use crate::{ReportError, graph, tracks, work, worst};
use tessera_outputs::html::{escaped, table};

/// Everything about one run. `prefix` tells its sections from those of other runs.
pub(crate) fn of_run(run: &ReportedRun, prefix: &str) -> Result<String, ReportError> {
    let mut out = String::new();
    let mut section = |id: &str, title: &str, body: &str| {
        out.push_str(&format!("<section id=\"{prefix}{id}\"><h3>{title}</h3>{body}</section>"));
    };
    section("summary", "Summary", &facts(&run.facts));
    section("scene", "Map and trajectory in 3D", &scene(run));
    section("trajectory", "Trajectory", &tracks::trajectory(run)?);
    let title = if run.has_truth() { "Error over time" } else { "Certainty over time" };
    section("error", title, &format!("{}{}", error_note(run), tracks::error(run)?));
    section("worst", "Frames to look at", &worst::html(run));
    section("graph", "Keyframes and loops", &graph::html(run)?);
    section(
        "latency",
        "Latency",
        &format!(
            "{}<div class=\"pair\"><div><h4>over time</h4>{}</div><div><h4>how often</h4>{}</div></div>",
            work::stages(run),
            work::latency_over_time(run)?,
            work::latency_distribution(run)?
        ),
    );
    section("memory", "Memory", &work::memory(run)?);
    section("events", "States, drops and restarts", &format!("{}{}", states(run), work::events(run)));
    section("settings", "Configuration", &settings(run));
    section("machine", "Machine", &facts(&run.machine));
    Ok(out)
}

fn scene(run: &ReportedRun) -> String {
    let elsewhere = "<p class=\"note\">Too many runs for one page: the report of this run alone has it.</p>";
    run.scene.as_ref().map_or_else(|| elsewhere.into(), crate::scene::ReportScene::html)
}

fn facts(facts: &[(String, String)]) -> String {
    let items: String = facts
        .iter()
        .map(|(name, value)| format!("<div><dt>{}</dt><dd>{}</dd></div>", escaped(name), escaped(value)))
        .collect();
    format!("<dl>{items}</dl>")
}

fn error_note(run: &ReportedRun) -> &'static str {
    if run.has_truth() {
        "<p class=\"note\">After the best rigid alignment of the whole, as the ATE is defined. Letters are the frames below.</p>"
    } else {
        "<p class=\"note\">There is no ground truth: what is shown is how sure the aligner was.</p>"
    }
}

fn states(run: &ReportedRun) -> String {
    let count = |state| run.frames.iter().filter(|frame| frame.state == state).count();
    let row = |name: &str, state| {
        let own: Vec<_> = run.frames.iter().filter(|frame| frame.state == state).collect();
        let first = own.first().map_or(String::new(), |frame| {
            let reason = if frame.reason.is_empty() { "" } else { ": " };
            format!("frame {}{reason}{}", frame.index, frame.reason)
        });
        vec![name.to_owned(), count(state).to_string(), first]
    };
    let mut rows = vec![vec!["tracking".to_owned(), count(FrameState::Tracking).to_string(), String::new()]];
    rows.push(row("lost", FrameState::Lost));
    rows.push(row("relocalising", FrameState::Relocalising));
    rows.push(row("dropped", FrameState::Dropped));
    table("states", &["state", "frames", "the first of them"], &rows)
}

fn settings(run: &ReportedRun) -> String {
    let differs = |setting: &&crate::run::Setting| setting.default.as_ref() != Some(&setting.value);
    let changed: Vec<Vec<String>> = run
        .settings
        .iter()
        .filter(differs)
        .map(|s| vec![s.key.clone(), s.value.clone(), s.default.clone().unwrap_or("–".into())])
        .collect();
    let all: Vec<Vec<String>> = run.settings.iter().map(|s| vec![s.key.clone(), s.value.clone()]).collect();
    let changed = if changed.is_empty() {
        "<p class=\"note\">All settings are those of the default.</p>".to_owned()
    } else {
        table("words", &["what differs from the default", "this run", "default"], &changed)
    };
    format!(
        "{changed}<details><summary>All settings ({})</summary>{}</details>",
        all.len(),
        table("words", &["setting", "value"], &all)
    )
}
