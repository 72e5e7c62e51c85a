//! Work of the processes: latency, restarts, drops, memory.

use crate::ReportError;
use crate::chart::{Band, Chart, ChartForm, Series};
use crate::palette::{GREY, VERMILION, cycled};
use crate::run::ReportedRun;
use tessera_outputs::Point;
use tessera_outputs::html::{escaped, table};

/// Fewer than so many are no distribution.
const LEAST_COUNT: u64 = 10;

/// Latency of each stage over the time of the run.
pub(crate) fn latency_over_time(run: &ReportedRun) -> Result<String, ReportError> {
    if run.samples.is_empty() {
        return Ok(
            "<p class=\"note\">Not recorded: the supervisor was gone before it could write.</p>".into()
        );
    }
    let series = of_each_stage(run, |point| point.mean_ms.map(|mean| mean.max(1e-3).log10()));
    Chart {
        what: "latency of each stage over time".into(),
        x_label: "time of the run, s".into(),
        y_label: "mean for a frame, ms".into(),
        bands: restarts(run),
        series,
        log: [false, true],
        also: restart_name(run),
        ..Chart::default()
    }
    .html()
}

/// How often a frame took how long.
pub(crate) fn latency_distribution(run: &ReportedRun) -> Result<String, ReportError> {
    let series = run.stages.iter().enumerate().filter_map(|(place, stage)| {
        let all: u64 = stage.latency_counts.iter().fold(0, |sum, (_, n)| sum.saturating_add(*n));
        if all < LEAST_COUNT {
            return None;
        }
        let mut points: Vec<(f64, f64)> = Vec::new();
        // As steps: each bucket as wide as it is.
        for (end_ms, n) in &stage.latency_counts {
            let share = 100.0 * *n as f64 / all as f64;
            let begin = points.last().map_or(end_ms.log10() - 0.08, |p| p.0);
            points.extend([(begin, share), (end_ms.log10(), share)]);
        }
        let first = points.iter().position(|p| p.1 > 0.0)?.saturating_sub(1);
        let last = points.iter().rposition(|p| p.1 > 0.0)?;
        let points = points.into_iter().take(last.saturating_add(2)).skip(first).collect();
        let colour = cycled(place);
        Some(Series { name: title(&stage.name), colour, points, size: 1.5, form: ChartForm::Line })
    });
    let series: Vec<Series> = series.collect();
    if series.is_empty() {
        return Ok("<p class=\"note\">Not recorded.</p>".into());
    }
    Chart {
        what: "distribution of latency".into(),
        x_label: "time for a frame, ms".into(),
        y_label: "% of frames".into(),
        series,
        log: [true, false],
        from_zero: true,
        ..Chart::default()
    }
    .html()
}

/// Highest resident set of each stage over the time of the run.
pub(crate) fn memory(run: &ReportedRun) -> Result<String, ReportError> {
    if run.samples.is_empty() {
        return Ok("<p class=\"note\">Not recorded.</p>".into());
    }
    let series = of_each_stage(run, |point| (point.peak_rss_mb > 0.0).then_some(point.peak_rss_mb));
    Chart {
        what: "memory of each stage over time".into(),
        x_label: "time of the run, s".into(),
        y_label: "MB".into(),
        bands: restarts(run),
        series,
        from_zero: true,
        also: restart_name(run),
        ..Chart::default()
    }
    .html()
}

/// Restarts, latency, CPU time and memory in numbers.
pub(crate) fn stages(run: &ReportedRun) -> String {
    let or_none = |value: Option<f64>| value.map_or("–".to_owned(), |value| format!("{value:.1}"));
    let row = |stage: &crate::run::StageFigures| {
        let [p50, p99, max] = stage.latency_ms;
        let mut row = vec![title(&stage.name)];
        row.push(stage.frames.to_string());
        row.push(if stage.peak_rss_mb.is_some() { stage.restarts.to_string() } else { "–".into() });
        row.extend([p50, p99, max].map(|ms| format!("{ms:.1}")));
        row.extend([or_none(stage.cpu_ms_per_frame), or_none(stage.peak_rss_mb)]);
        row
    };
    let head = ["stage", "done", "restarts", "p50 ms", "p99 ms", "longest ms", "CPU ms a frame", "peak MB"];
    table("numbers", &head, &run.stages.iter().map(row).collect::<Vec<_>>())
}

/// What the log warns of.
pub(crate) fn events(run: &ReportedRun) -> String {
    if run.events.is_empty() {
        return "<p class=\"note\">Nothing: no death, no warning, no error.</p>".into();
    }
    let lines: String = run
        .events
        .iter()
        .map(|event| {
            let class = if event.level == "ERROR" { "error" } else { "warn" };
            format!(
                "<li><time>{}</time> <b class=\"{class}\">{}</b> {}</li>",
                escaped(&event.time),
                escaped(&event.level.to_lowercase()),
                escaped(&event.words)
            )
        })
        .collect();
    let more = match run.n_more_events {
        0 => String::new(),
        n => format!("<p class=\"note\">{n} earlier ones are in log.txt.</p>"),
    };
    let open = if run.events.len() <= 12 { " open" } else { "" };
    let n = run.events.len().saturating_add(run.n_more_events);
    format!(
        "<details{open}><summary>Warnings and errors in the log ({n})</summary>{more}<ul class=\"log\">{lines}</ul></details>"
    )
}

fn title(name: &str) -> String {
    name.replace('_', " ")
}

fn of_each_stage(run: &ReportedRun, value: impl Fn(&Point) -> Option<f64>) -> Vec<Series> {
    let series = run.stages.iter().enumerate().map(|(place, stage)| {
        let points = run
            .samples
            .iter()
            .filter_map(|sample| value(sample.stages.get(&stage.name)?).map(|value| (sample.at_s, value)));
        let colour = cycled(place);
        let points: Vec<_> = points.collect();
        // A line through one point cannot be seen.
        let (form, size) = if points.len() == 1 { (ChartForm::Dots, 3.0) } else { (ChartForm::Line, 1.4) };
        Series { name: title(&stage.name), colour, points, size, form }
    });
    series.filter(|series| !series.points.is_empty()).collect()
}

/// Times between samples in which a stage was started again.
fn restarts(run: &ReportedRun) -> Vec<Band> {
    let mut begin = 0.0;
    let mut bands = Vec::new();
    for sample in &run.samples {
        if sample.stages.values().any(|stage| stage.restarts > 0) {
            bands.push(Band { x: begin..sample.at_s, colour: VERMILION });
        } else if sample.stages.values().any(|stage| stage.dropped > 0) {
            bands.push(Band { x: begin..sample.at_s, colour: GREY });
        }
        begin = sample.at_s;
    }
    bands
}

fn restart_name(run: &ReportedRun) -> Vec<(String, plotters::style::RGBColor)> {
    let any = |of: fn(&Point) -> u64| run.samples.iter().flat_map(|s| s.stages.values()).any(|s| of(s) > 0);
    let names = [(any(|s| s.restarts), "restart", VERMILION), (any(|s| s.dropped), "frames dropped", GREY)];
    names.into_iter().filter(|(is, ..)| *is).map(|(_, name, colour)| (name.to_owned(), colour)).collect()
}
