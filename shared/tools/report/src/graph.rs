//! Keyframes, what they were aligned to, and the loops among them with their verdicts.

use crate::ReportError;
use crate::chart::{Chart, ChartForm, Series};
use crate::palette::{BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION};
use crate::run::{Keyframe, LoopPair, ReportedRun, ReportedVerdict};
use std::collections::BTreeSet;
use tessera_outputs::html::table;

/// Longest table of loops.
const MOST_ROWS: usize = 200;

/// Most submaps named in the legend; of more their number.
const MOST_NAMED: usize = 4;

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
    let part = |id: u32| run.keyframes.get(id as usize).and_then(|k| k.apart);
    // A line between maps that are apart would say how they lie to each other.
    let pair = |newer, older| (part(newer) == part(older)).then_some([place(newer)?, place(older)?]);
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
    let mut dots = |name: &str, colour, is_one: &dyn Fn(&Keyframe) -> bool| {
        let own = run.keyframes.iter().filter(|k| is_one(k));
        let points: Vec<_> = own.map(|k| (k.position_m[0], k.position_m[1])).collect();
        if !points.is_empty() {
            series.push(Series { name: name.into(), colour, points, size: 2.5, form: ChartForm::Dots });
        }
    };
    dots("keyframe of the map it started in", ORANGE, &|k| k.apart.is_none() && k.is_of_map);
    dots("keyframe", BLUE, &|k| k.apart.is_none() && !k.is_of_map);
    let apart: BTreeSet<u32> = run.keyframes.iter().filter_map(|k| k.apart).collect();
    dots(&words_of_apart(&apart), SKY, &|k| k.apart.is_some());
    let chart = Chart {
        what: "keyframes and loops from above".into(),
        x_label: "right, m".into(),
        y_label: "forward, m".into(),
        series,
        is_map: true,
        ..Chart::default()
    };
    Ok(format!("{}{}{}", note_of_apart(&apart), chart.html()?, loops(run)))
}

/// The submaps that are apart, as the legend has them.
fn words_of_apart(apart: &BTreeSet<u32>) -> String {
    let numbers: Vec<String> = apart.iter().map(u32::to_string).collect();
    match numbers.as_slice() {
        [one] => format!("keyframe of submap {one}, place unknown"),
        few if few.len() <= MOST_NAMED => format!("keyframe of submaps {}, places unknown", few.join(", ")),
        many => format!("keyframe of {} submaps, places unknown", many.len()),
    }
}

fn note_of_apart(apart: &BTreeSet<u32>) -> &'static str {
    if apart.is_empty() {
        return "";
    }
    "<p class=\"note\">Submaps that could not be joined stand to the right of the main map; how they lie to it is not known.</p>"
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn submaps_that_are_apart_are_told_in_the_legend_and_no_line_leads_there() {
        let keyframe = |id: u32, apart| {
            let position_m = [f64::from(id), 0.0, 0.0];
            Keyframe { id, position_m, apart, edges: (0..id).collect(), ..Keyframe::default() }
        };
        let run_of = |apart| ReportedRun {
            keyframes: vec![keyframe(0, None), keyframe(1, None), keyframe(2, apart)],
            ..ReportedRun::default()
        };
        let [whole, apart] = [None, Some(2)].map(|apart| html(&run_of(apart)).unwrap());
        assert!(!whole.contains("submap") && !whole.contains("not known"), "{whole}");
        assert!(apart.contains("keyframe of submap 2, place unknown") && apart.contains("is not known"));
        assert!(
            apart.matches("<path").count() + apart.matches("<polyline").count()
                < whole.matches("<path").count() + whole.matches("<polyline").count()
        );
        let numbers = |n: u32| words_of_apart(&(1..=n).collect());
        assert_eq!(numbers(2), "keyframe of submaps 1, 2, places unknown");
        assert_eq!(numbers(5), "keyframe of 5 submaps, places unknown");
    }
}
