//! Trajectory of the camera, and its error.

use crate::ReportError;
use crate::chart::{Band, Chart, ChartFollow, ChartForm, ChartMark, Series};
use crate::palette::{BLUE, GREY, ORANGE, SKY, VERMILION};
use crate::run::{Frame, FrameState, ReportedRun};
use crate::worst::letter;

/// The way from above and from the side.
pub(crate) fn trajectory(run: &ReportedRun) -> Result<String, ReportError> {
    let views =
        [("from above", [0, 1], "right, m", "forward, m"), ("from the side", [0, 2], "right, m", "up, m")];
    let mut out = String::from("<div class=\"pair\">");
    for (view, axes, x_label, y_label) in views {
        #[expect(clippy::indexing_slicing, reason = "two of three axes")]
        let flat = |p: &[f64; 3]| (p[axes[0]], p[axes[1]]);
        let mut series = Vec::new();
        if run.has_truth() {
            series.push(Series {
                name: "ground truth".into(),
                colour: GREY,
                points: run.truth_m.iter().map(flat).collect(),
                size: 3.0,
                form: ChartForm::Line,
            });
        }
        let own = run.frames.iter().filter(|frame| frame.state != FrameState::Dropped);
        series.push(Series {
            name: "estimate".into(),
            colour: BLUE,
            points: own.map(|frame| flat(&frame.position_m)).collect(),
            size: 1.4,
            form: ChartForm::Line,
        });
        let lost: Vec<_> =
            run.frames.iter().filter(|f| f.state == FrameState::Lost).map(|f| flat(&f.position_m)).collect();
        if !lost.is_empty() {
            let name = "lost".into();
            series.push(Series { name, colour: VERMILION, points: lost, size: 2.5, form: ChartForm::Dots });
        }
        let marks = marks(run, |frame| Some(flat(&frame.position_m)));
        let chart = Chart {
            what: format!("trajectory {view}"),
            x_label: x_label.into(),
            y_label: y_label.into(),
            series,
            marks,
            is_map: true,
            follow: ChartFollow::Position(axes),
            ..Chart::default()
        };
        out.push_str(&format!("<div><h4>{view}</h4>{}</div>", chart.html()?));
    }
    out.push_str("</div>");
    Ok(out)
}

fn marks(run: &ReportedRun, at: impl Fn(&Frame) -> Option<(f64, f64)>) -> Vec<ChartMark> {
    run.worst
        .iter()
        .enumerate()
        .filter_map(|(place, worst)| {
            let frame = run.frames.iter().find(|frame| frame.index == worst.index)?;
            Some(ChartMark { at: at(frame)?, letter: letter(place) })
        })
        .collect()
}

/// Error over time, or the aligner's own standard deviations where there is no ground truth.
pub(crate) fn error(run: &ReportedRun) -> Result<String, ReportError> {
    let mut series = Vec::new();
    let millimetres = |value: fn(&Frame) -> Option<f64>| -> Vec<(f64, f64)> {
        run.frames.iter().filter_map(|f| value(f).map(|m| (f.time_s, 1e3 * m))).collect()
    };
    if run.has_truth() {
        let (points, name) = (millimetres(|f| f.error_m), "distance to the ground truth".into());
        series.push(Series { name, colour: BLUE, points, size: 1.5, form: ChartForm::Line });
    }
    let colour = if run.has_truth() { SKY } else { BLUE };
    let name = "standard deviation as the aligner sees it".into();
    series.push(Series { name, colour, points: millimetres(|f| f.std_m), size: 1.0, form: ChartForm::Line });
    let value = |f: &Frame| f.error_m.or(f.std_m).map(|m| (f.time_s, 1e3 * m));
    Chart {
        what: "error over time".into(),
        x_label: "time in the recording, s".into(),
        y_label: "mm".into(),
        bands: bands(run),
        series,
        marks: marks(run, |frame| if run.has_truth() { value(frame) } else { None }),
        from_zero: true,
        also: band_names(run),
        follow: ChartFollow::Time,
        ..Chart::default()
    }
    .html()
}

const BANDS: [(FrameState, &str, plotters::style::RGBColor); 3] = [
    (FrameState::Lost, "lost", VERMILION),
    (FrameState::Relocalising, "relocalising", ORANGE),
    (FrameState::Dropped, "dropped", GREY),
];

fn band_names(run: &ReportedRun) -> Vec<(String, plotters::style::RGBColor)> {
    let has = |state| run.frames.iter().any(|frame| frame.state == state);
    BANDS.iter().filter(|(state, ..)| has(*state)).map(|(_, name, c)| ((*name).into(), *c)).collect()
}

/// Frames in a row that were not tracked.
fn bands(run: &ReportedRun) -> Vec<Band> {
    let mut bands: Vec<(FrameState, Band)> = Vec::new();
    for (place, frame) in run.frames.iter().enumerate() {
        let Some((state, _, colour)) = BANDS.iter().find(|(state, ..)| *state == frame.state) else {
            continue;
        };
        let end = run.frames.get(place.saturating_add(1)).map_or(frame.time_s, |next| next.time_s);
        match bands.last_mut() {
            Some((last, band)) if last == state && band.x.end >= frame.time_s => band.x.end = end,
            _ => bands.push((*state, Band { x: frame.time_s..end, colour: *colour })),
        }
    }
    bands.into_iter().map(|(_, band)| band).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_lost_in_a_row_are_one_band() {
        let frame = |index: u64, state| Frame { index, time_s: index as f64, state, ..Frame::default() };
        use FrameState::{Dropped, Lost, Tracking};
        let states = [Tracking, Lost, Lost, Tracking, Dropped, Lost];
        let run = ReportedRun {
            frames: states.into_iter().enumerate().map(|(k, state)| frame(k as u64, state)).collect(),
            ..ReportedRun::default()
        };
        let spans: Vec<_> = bands(&run).into_iter().map(|band| band.x).collect();
        assert_eq!(spans, [1.0..3.0, 4.0..5.0, 5.0..5.0]);
        assert_eq!(band_names(&run).len(), 2);
    }
}
