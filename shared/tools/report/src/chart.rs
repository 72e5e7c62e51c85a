//! A plot as SVG, drawn twice: wide for screens and paper, narrow for phones.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::cast_possible_truncation,
    reason = "pixels of a drawing whose size is constant"
)]

use crate::ReportError;
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::ops::Range;
use tessera_outputs::html::escaped;

/// The SVG library rounds to whole units: plots are drawn this much larger than they are shown.
const FINE: u32 = 5;
/// Most points of a line: more cannot be seen.
const MOST_POINTS: usize = 1500;

/// A line through points, or dots at them.
pub struct Series {
    /// What the legend says; empty: nothing.
    pub name: String,
    /// Of line or dots.
    pub colour: RGBColor,
    /// In the order in which they are joined; what is not finite is left out.
    pub points: Vec<(f64, f64)>,
    /// Width of the line or radius of the dots, pixels.
    pub size: f64,
    /// How they are drawn.
    pub form: ChartForm,
}

/// How points are drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum ChartForm {
    /// Joined.
    Line,
    /// Apart.
    Dots,
    /// Pairs of points, each joined.
    Segments,
}

/// Ranges of x and y, and the pixels of a drawing that they have.
type DrawnAxes = (Range<f64>, Range<f64>, Range<i32>, Range<i32>);

/// How much of a band's colour is seen; `style.css` says the same of its legend.
const BAND_OPACITY: f64 = 0.25;

/// A span of x to be noticed.
pub struct Band {
    /// From, to.
    pub x: Range<f64>,
    /// Seen through.
    pub colour: RGBColor,
}

/// A letter at a point.
pub struct ChartMark {
    /// Where.
    pub at: (f64, f64),
    /// Which.
    pub letter: String,
}

/// What of a plot follows the frame that the view in 3D is at.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChartFollow {
    /// Nothing.
    #[default]
    Nothing,
    /// A line at its time in the recording: x is that time.
    Time,
    /// A dot at its position: which axes of the page x and y are.
    Position([usize; 2]),
}

/// A plot.
#[derive(Default)]
pub struct Chart {
    /// What it shows, for those who hear it and for messages.
    pub what: String,
    /// What x is, and its unit.
    pub x_label: String,
    /// What y is, and its unit.
    pub y_label: String,
    /// Spans of x to be noticed.
    pub bands: Vec<Band>,
    /// Later ones lie on top.
    pub series: Vec<Series>,
    /// Letters at points.
    pub marks: Vec<ChartMark>,
    /// One metre is as long along x as along y.
    pub is_map: bool,
    /// x or y are decimal logarithms and labelled by what they stand for.
    pub log: [bool; 2],
    /// y begins at 0.
    pub from_zero: bool,
    /// Further lines of the legend, for bands.
    pub also: Vec<(String, RGBColor)>,
    /// What of it follows the frame that the view in 3D is at.
    pub follow: ChartFollow,
}

impl Chart {
    /// The plot with its legend.
    ///
    /// # Errors
    /// What the drawing library refuses.
    pub fn html(&self) -> Result<String, ReportError> {
        let wide = self.svg(760, if self.is_map { 440 } else { 270 }, 13)?;
        let narrow = self.svg(370, if self.is_map { 340 } else { 240 }, 12)?;
        let what = escaped(&self.what);
        let legend = self.legend();
        Ok(format!(
            "<figure><div class=\"wide\" role=\"img\" aria-label=\"{what}\"{}>{}</div>\
             <div class=\"narrow\" role=\"img\" aria-label=\"{what}\"{}>{}</div>{legend}</figure>",
            self.followed(&wide.1),
            wide.0,
            self.followed(&narrow.1),
            narrow.0
        ))
    }

    /// What the script needs to follow a frame: what is followed, and the frame of the axes.
    fn followed(&self, frame: &[f64; 8]) -> String {
        let what = match self.follow {
            ChartFollow::Nothing => return String::new(),
            ChartFollow::Time => "time".to_owned(),
            ChartFollow::Position([x, y]) => format!("{x} {y}"),
        };
        let frame = frame.map(|number| format!("{number:.4}")).join(" ");
        format!(" data-follow=\"{what}\" data-frame=\"{frame}\"")
    }

    fn legend(&self) -> String {
        let class = |form| if form == ChartForm::Dots { "dot" } else { "line" };
        let own = self.series.iter().map(|s| (&s.name, s.colour, class(s.form)));
        let all = own.chain(self.also.iter().map(|(name, colour)| (name, *colour, "band")));
        let entries: String = all
            .filter(|(name, ..)| !name.is_empty())
            .map(|(name, RGBColor(r, g, b), class)| {
                let name = escaped(name);
                format!("<span><i class=\"{class}\" style=\"background:rgb({r},{g},{b})\"></i>{name}</span>")
            })
            .collect();
        if entries.is_empty() { entries } else { format!("<figcaption>{entries}</figcaption>") }
    }

    /// The drawing, and the frame of its axes: both ends of x and of y, then where they are, left, right, bottom and
    /// top, as shares of the drawing.
    fn svg(&self, width: u32, height: u32, font: u32) -> Result<(String, [f64; 8]), ReportError> {
        let mut text = String::new();
        let size = (width * FINE, height * FINE);
        let drawn = {
            let area = SVGBackend::with_string(&mut text, size).into_drawing_area();
            self.draw(&area, font * FINE)
                .and_then(|f| area.present().map(|()| f).map_err(|error| error.to_string()))
        };
        let (x, y, columns, rows) =
            drawn.map_err(|reason| ReportError { what: self.what.clone(), reason })?;
        // As wide as its place: the view box keeps the proportions.
        let fixed = format!("<svg width=\"{}\" height=\"{}\"", size.0, size.1);
        let across = |px: i32| f64::from(px) / f64::from(size.0);
        let down = |px: i32| f64::from(px) / f64::from(size.1);
        let places = [across(columns.start), across(columns.end), down(rows.end), down(rows.start)];
        let [left, right, bottom, top] = places;
        let frame = [x.start, x.end, y.start, y.end, left, right, bottom, top];
        Ok((text.replacen(&fixed, "<svg", 1).replace('\n', ""), frame))
    }

    /// Draws, and answers the ranges of both axes and the pixels that they have.
    fn draw(&self, area: &DrawingArea<SVGBackend<'_>, Shift>, font: u32) -> Result<DrawnAxes, String> {
        let label_area = (font as f64 * 1.2 + 20.0 * f64::from(FINE)) as u32;
        let y_area = font * 4 + 2 * FINE;
        let (x, y) = self.ranges(area.dim_in_pixel(), (y_area, label_area));
        let n_labels = (area.dim_in_pixel().0 / FINE / 60).clamp(5, 11) as usize;
        let steps = [step(&x, n_labels), step(&y, if self.is_map { 7 } else { 5 })];
        let mut chart = ChartBuilder::on(area)
            .margin(6 * FINE)
            .margin_right(14 * FINE)
            .x_label_area_size(label_area)
            .y_label_area_size(y_area)
            .build_cartesian_2d(x.clone(), y.clone())
            .map_err(|error| error.to_string())?;
        chart
            .configure_mesh()
            .x_labels(n_labels)
            .y_labels(if self.is_map { 7 } else { 5 })
            .x_label_formatter(&|v| label(*v, self.log[0], steps[0]))
            .y_label_formatter(&|v| label(*v, self.log[1], steps[1]))
            .x_desc(&self.x_label)
            .y_desc(&self.y_label)
            .label_style(("sans-serif", font))
            .axis_desc_style(("sans-serif", font))
            .axis_style(BLACK.mix(0.4).stroke_width(FINE))
            .bold_line_style(BLACK.mix(0.1).stroke_width(FINE))
            .light_line_style(TRANSPARENT)
            .set_all_tick_mark_size(4 * FINE)
            .draw()
            .map_err(|error| error.to_string())?;
        for band in &self.bands {
            let corners = [(band.x.start.max(x.start), y.start), (band.x.end.min(x.end), y.end)];
            chart
                .draw_series([Rectangle::new(corners, band.colour.mix(BAND_OPACITY).filled())])
                .map_err(|error| error.to_string())?;
        }
        for series in &self.series {
            let stroke = series.colour.stroke_width((series.size * f64::from(FINE)) as u32);
            let points = thinned(&series.points, series.form);
            match series.form {
                ChartForm::Line => chart.draw_series(LineSeries::new(points, stroke)).map(|_| ()),
                ChartForm::Dots => {
                    let radius = (series.size * f64::from(FINE)) as i32;
                    let dots = points.into_iter().map(|at| Circle::new(at, radius, series.colour.filled()));
                    chart.draw_series(dots).map(|_| ())
                }
                ChartForm::Segments => {
                    let pairs: Vec<_> = points.chunks_exact(2).map(<[_]>::to_vec).collect();
                    chart.draw_series(pairs.into_iter().map(|p| PathElement::new(p, stroke))).map(|_| ())
                }
            }
            .map_err(|error| error.to_string())?;
        }
        for mark in &self.marks {
            let centre = Pos::new(HPos::Center, VPos::Center);
            let style = TextStyle::from(("sans-serif", font).into_font()).color(&WHITE).pos(centre);
            let at = EmptyElement::at(mark.at)
                + Circle::new((0, 0), font as i32 * 2 / 3, BLACK.filled())
                + Text::new(mark.letter.clone(), (0, 0), style);
            chart.draw_series([at]).map_err(|error| error.to_string())?;
        }
        let (columns, rows) = chart.plotting_area().get_pixel_range();
        Ok((x, y, columns, rows))
    }

    /// Ranges that hold all points, in equal scale for a map.
    fn ranges(&self, size: (u32, u32), areas: (u32, u32)) -> (Range<f64>, Range<f64>) {
        let points = || self.series.iter().flat_map(|s| &s.points);
        let mut x = span(points().map(|p| p.0));
        let mut y = span(points().map(|p| p.1));
        if self.from_zero {
            y.start = 0.0;
        }
        let (width_px, height_px) = (
            f64::from(size.0.saturating_sub(areas.0 + 20 * FINE)),
            f64::from(size.1.saturating_sub(areas.1 + 12 * FINE)),
        );
        if self.is_map {
            let metres_per_px =
                ((x.end - x.start) / width_px).max((y.end - y.start) / height_px).max(1e-6) * 1.08;
            x = around(&x, 0.5 * metres_per_px * width_px);
            y = around(&y, 0.5 * metres_per_px * height_px);
        } else {
            y.end += 0.06 * (y.end - y.start);
        }
        (x, y)
    }
}

/// What holds all values; never empty.
fn span(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (low, high) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return 0.0..1.0;
    }
    if high - low < 1e-9 { low - 0.5..high + 0.5 } else { low..high }
}

fn around(range: &Range<f64>, half: f64) -> Range<f64> {
    let middle = 0.5 * (range.start + range.end);
    middle - half..middle + half
}

/// About how far apart the labels of an axis are.
fn step(range: &Range<f64>, n_labels: usize) -> f64 {
    (range.end - range.start) / n_labels as f64
}

/// A number with the digits that its neighbours need.
fn label(value: f64, is_log: bool, step: f64) -> String {
    if is_log {
        let value = 10f64.powf(value);
        let digits = if value < 0.095 {
            2
        } else if value < 9.5 {
            1
        } else {
            0
        };
        return format!("{value:.digits$}");
    }
    let digits = (0..4).find(|&d| step * 10f64.powi(d) >= 0.99).unwrap_or(4) as usize;
    let text = format!("{value:.digits$}");
    // No minus before nothing.
    if text.chars().all(|c| "-0.".contains(c)) { text.trim_start_matches('-').to_owned() } else { text }
}

/// As many points as can be seen, the first and the last among them.
fn thinned(points: &[(f64, f64)], form: ChartForm) -> Vec<(f64, f64)> {
    let finite = || points.iter().copied().filter(|p| p.0.is_finite() && p.1.is_finite());
    if form == ChartForm::Segments || points.len() <= MOST_POINTS {
        return if form == ChartForm::Segments { points.to_vec() } else { finite().collect() };
    }
    // Of each bunch the highest, so that no peak goes missing.
    let bunch = points.len().div_ceil(MOST_POINTS);
    let all: Vec<(f64, f64)> = finite().collect();
    all.chunks(bunch).filter_map(|bunch| bunch.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::palette::BLUE;

    fn chart() -> Chart {
        Chart {
            what: "a <test>".into(),
            series: vec![Series {
                name: "line".into(),
                colour: BLUE,
                points: vec![(0.0, 0.0), (1.0, f64::NAN), (2.0, 1.0)],
                size: 1.5,
                form: ChartForm::Line,
            }],
            ..Chart::default()
        }
    }

    #[test]
    fn a_plot_is_drawn_in_both_widths_with_its_legend() {
        let html = chart().html().unwrap();
        assert_eq!(html.matches("<svg").count(), 2);
        assert!(html.contains("a &lt;test&gt;") && html.contains("</i>line</span>"), "{html}");
        assert!(!html.contains("NaN") && !html.contains("<svg width"), "{html}");
    }

    #[test]
    fn what_follows_the_frames_has_the_frame_of_its_axes() {
        assert!(!chart().html().unwrap().contains("data-follow"));
        let html = Chart { follow: ChartFollow::Time, ..chart() }.html().unwrap();
        let (_, rest) = html.split_once("data-follow=\"time\" data-frame=\"").unwrap();
        let frame =
            rest.split('"').next().unwrap().split(' ').map(|n| n.parse().unwrap()).collect::<Vec<f64>>();
        let [x0, x1, y0, y1, left, right, bottom, top] = frame[..] else { panic!("{frame:?}") };
        // A twentieth of the height is left above the highest point.
        assert_eq!((x0, x1, y0, y1), (0.0, 2.0, 0.0, 1.06));
        assert!(0.0 < left && left < 0.15 && 0.95 < right && right < 1.0, "{frame:?}");
        assert!(0.0 < top && top < 0.1 && 0.7 < bottom && bottom < 1.0, "{frame:?}");
        // The first point of the line is drawn at the left end of both axes.
        let [x, y] = [left * 760.0 * f64::from(FINE), bottom * 270.0 * f64::from(FINE)].map(f64::round);
        let drawn = format!("points=\"{x},{y} ");
        assert!(html.contains(&drawn), "{drawn} is not in {html}");
        let map = Chart { follow: ChartFollow::Position([0, 2]), is_map: true, ..chart() }.html().unwrap();
        assert_eq!(map.matches("data-follow=\"0 2\"").count(), 2);
    }

    #[test]
    fn a_band_looks_in_the_legend_as_it_is_drawn() {
        let band = Chart { also: vec![("restart".into(), BLUE)], ..chart() };
        let html = band.html().unwrap();
        assert!(html.contains("<i class=\"band\"") && html.contains("</i>restart</span>"), "{html}");
        let style = include_str!("style.css");
        let line = style.lines().find(|line| line.contains(".band")).unwrap();
        assert!(line.contains(&format!("opacity: {BAND_OPACITY};")), "{line}");
    }

    #[test]
    fn nothing_and_one_point_can_be_drawn() {
        Chart::default().html().unwrap();
        let mut one = chart();
        one.series[0].points = vec![(3.0, 3.0)];
        one.is_map = true;
        one.html().unwrap();
    }

    #[test]
    fn peaks_survive_thinning() {
        let mut points: Vec<(f64, f64)> = (0..100_000).map(|k| (f64::from(k), 0.0)).collect();
        points[54_321].1 = 7.0;
        let kept = thinned(&points, ChartForm::Line);
        assert!(kept.len() <= MOST_POINTS);
        assert!(kept.contains(&(54_321.0, 7.0)));
    }

    #[test]
    fn labels_have_the_digits_they_need() {
        assert_eq!(label(0.25, false, 0.05), "0.25");
        assert_eq!(label(-0.0, false, 1.0), "0");
        assert_eq!(label(120.0, false, 20.0), "120");
        assert_eq!(label(0.5, true, 0.5), "3.2");
    }
}
