//! Keyframes, what they were aligned to, and the loops among them with their verdicts.

use crate::ReportError;
use crate::chart::{BLUE, Chart, ChartForm, GREEN, GREY, ORANGE, PURPLE, Series, VERMILION};
use crate::run::{LoopPair, ReportedRun, ReportedVerdict};
use tessera_outputs::html::table;

/// Longest table of loops.
const MOST_ROWS: usize = 200;

/// What each verdict is called, and its colour.
const VERDICTS: [(ReportedVerdict, &str, plotters::style::RGBColor); 4] = [
    (ReportedVerdict::Refused, "loop not verified", ORANGE),
    (ReportedVerdict::Outvoted, "loop rejected", VERMILION),
    (ReportedVerdict::Untested, "loop closed by the aligner alone", PURPLE),
    (ReportedVerdict::Accepted, "loop closed", GREEN),
];

/// The graph from above and the table of its loops.
pub(crate) fn html(run: &ReportedRun) -> Result<String, ReportError> {
    let place = |id: u32| run.keyframes.get(id as usize).map(|k| (k.position_m[0], k.position_m[1]));
    let pair = |newer, older| Some([place(newer)?, place(older)?]);
    let is_loop = |newer, older| run.loops.iter().any(|pair| pair.newer == newer && pair.older == older);
    let edges = run.keyframes.iter().flat_map(|k| k.edges.iter().map(move |&to| (k.id, to)));
    let plain = edges.filter(|&(newer, older)| !is_loop(newer, older));
    let mut series = vec![Series {
        name: "aligned to each other".into(),
        colour: GREY,
        points: plain.filter_map(|(newer, older)| pair(newer, older)).flatten().collect(),
        size: 0.8,
        form: ChartForm::Segments,
    }];
    for (verdict, name, colour) in VERDICTS {
        let pairs = run.loops.iter().filter(|pair| pair.verdict == verdict);
        let points: Vec<_> = pairs.filter_map(|p| pair(p.newer, p.older)).flatten().collect();
        if !points.is_empty() {
            let name = format!("{name} ({})", points.len() / 2);
            series.push(Series { name, colour, points, size: 1.4, form: ChartForm::Segments });
        }
    }
    for (is_of_map, name, colour) in
        [(true, "keyframe of the map it started in", ORANGE), (false, "keyframe", BLUE)]
    {
        let own = run.keyframes.iter().filter(|k| k.is_of_map == is_of_map);
        let points: Vec<_> = own.map(|k| (k.position_m[0], k.position_m[1])).collect();
        if !points.is_empty() {
            series.push(Series { name: name.into(), colour, points, size: 2.5, form: ChartForm::Dots });
        }
    }
    let chart = Chart {
        what: "keyframes and loops from above".into(),
        x_label: "right, m".into(),
        y_label: "forward, m".into(),
        series,
        is_map: true,
        ..Chart::default()
    };
    Ok(format!("{}{}", chart.html()?, loops(run)))
}

fn loops(run: &ReportedRun) -> String {
    if run.loops.is_empty() {
        return "<p class=\"note\">No pair of keyframes that would close a loop.</p>".into();
    }
    let row = |pair: &LoopPair| {
        let [overlap, in_front, inconsistency, residual, weight] = pair.numbers;
        let number = |value: f64, digits: usize| {
            if value.is_finite() { format!("{value:.digits$}") } else { "–".into() }
        };
        vec![
            format!("{} – {}", pair.newer, pair.older),
            pair.words.clone(),
            number(100.0 * overlap, 0),
            number(100.0 * in_front, 1),
            number(inconsistency, 2),
            number(residual, 2),
            number(weight, 2),
        ]
    };
    let rows: Vec<Vec<String>> = run.loops.iter().take(MOST_ROWS).map(row).collect();
    let head = ["pair", "verdict", "overlap %", "in front %", "inconsistency σ", "residual σ", "weight"];
    let more = run.loops.len().saturating_sub(MOST_ROWS);
    let more = if more > 0 { format!("<p class=\"note\">{more} more</p>") } else { String::new() };
    format!(
        "<details{}><summary>Each loop and its verdict ({})</summary>{}{more}</details>",
        if run.loops.len() <= 12 { " open" } else { "" },
        run.loops.len(),
        table("numbers second", &head, &rows)
    )
}
