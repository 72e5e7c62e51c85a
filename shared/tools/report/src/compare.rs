//! Several runs side by side.

use crate::ReportError;
use crate::chart::{Chart, ChartForm, Series};
use crate::palette::cycled;
use crate::run::ReportedRun;
use std::collections::BTreeSet;
use tessera_outputs::html::table;

/// What differs between the runs: numbers, errors over time, settings.
pub(crate) fn html(runs: &[ReportedRun]) -> Result<String, ReportError> {
    let mut head = vec![""];
    head.extend(runs.iter().map(|run| run.name.as_str()));
    let names = in_order(runs.iter().map(|run| run.facts.iter().map(|(name, _)| name.as_str()).collect()));
    let value = |run: &ReportedRun, name: &str| {
        let found = run.facts.iter().find(|(own, _)| own == name);
        found.map_or("–".to_owned(), |(_, value)| value.clone())
    };
    let mut rows: Vec<Vec<String>> = vec![row("verdict", runs.iter().map(|run| run.ended.clone()))];
    rows.extend(names.iter().map(|name| row(name, runs.iter().map(|run| value(run, name)))));
    let errors = errors(runs)?;
    Ok(format!(
        "<section id=\"compare\"><h2>Side by side</h2>{}{errors}<h3>Settings that differ</h3>{}</section>",
        table("numbers", &head, &rows),
        settings(runs, &head)
    ))
}

fn row(name: &str, cells: impl Iterator<Item = String>) -> Vec<String> {
    std::iter::once(name.to_owned()).chain(cells).collect()
}

/// Every name once, in the order of their first appearance.
fn in_order<'a>(lists: impl Iterator<Item = Vec<&'a str>>) -> Vec<&'a str> {
    let mut seen = BTreeSet::new();
    lists.flatten().filter(|name| seen.insert(*name)).collect()
}

fn errors(runs: &[ReportedRun]) -> Result<String, ReportError> {
    let series: Vec<Series> = runs
        .iter()
        .enumerate()
        .filter(|(_, run)| run.has_truth())
        .map(|(place, run)| Series {
            name: run.name.clone(),
            colour: cycled(place),
            points: run.frames.iter().filter_map(|f| f.error_m.map(|m| (f.time_s, 1e3 * m))).collect(),
            size: 1.4,
            form: ChartForm::Line,
        })
        .collect();
    if series.is_empty() {
        return Ok(String::new());
    }
    let chart = Chart {
        what: "error over time of each run".into(),
        x_label: "time in the recording, s".into(),
        y_label: "mm".into(),
        series,
        from_zero: true,
        ..Chart::default()
    };
    Ok(format!("<h3>Distance to the ground truth</h3>{}", chart.html()?))
}

fn settings(runs: &[ReportedRun], head: &[&str]) -> String {
    let keys = in_order(runs.iter().map(|run| run.settings.iter().map(|s| s.key.as_str()).collect()));
    let value = |run: &ReportedRun, key: &str| {
        let found = run.settings.iter().find(|setting| setting.key == key);
        found.map_or("–".to_owned(), |setting| setting.value.clone())
    };
    let rows: Vec<Vec<String>> = keys
        .iter()
        .map(|key| std::iter::once((*key).to_owned()).chain(runs.iter().map(|run| value(run, key))).collect())
        .filter(|row: &Vec<String>| row.iter().skip(2).any(|value| Some(value) != row.get(1)))
        .collect();
    if rows.is_empty() {
        return "<p class=\"note\">None.</p>".into();
    }
    table("words", head, &rows)
}
