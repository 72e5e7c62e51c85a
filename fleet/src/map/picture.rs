//! Plots of the report as SVG: ways from above, lines over time, bars.

use std::fmt::Write;
use tessera_outputs::html::escaped;

/// Colours that stay apart in print and for the colour-blind (Okabe and Ito), black among them.
const CYCLE: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#be6496", "#e69f00", "#56b4e9", "#000000"];
/// Size of a plot and of its margins in its own units.
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 400.0;
const LEFT: f64 = 56.0;
const BELOW: f64 = 28.0;
const EDGE: f64 = 12.0;
const ROW: f64 = 22.0;

/// The colour of the robot that came as number `place`.
pub(crate) fn colour(place: usize) -> &'static str {
    CYCLE[place % CYCLE.len()]
}

/// The same as red, green, blue, for a dark ground.
pub(crate) fn rgb(place: usize) -> [u8; 3] {
    const BRIGHT: [[u8; 3]; 7] = [
        [86, 156, 255],
        [255, 120, 50],
        [60, 200, 150],
        [230, 140, 190],
        [240, 180, 40],
        [150, 215, 255],
        [235, 235, 235],
    ];
    BRIGHT[place % BRIGHT.len()]
}

/// A line through points.
pub(crate) struct Line {
    pub(crate) name: String,
    pub(crate) colour: &'static str,
    pub(crate) points: Vec<(f64, f64)>,
}

/// Spans of time beside a name.
pub(crate) struct BarRow {
    pub(crate) name: String,
    pub(crate) colour: &'static str,
    pub(crate) spans: Vec<(f64, f64)>,
}

/// From values to places in the plot.
struct Axes {
    x: (f64, f64),
    y: (f64, f64),
}

impl Axes {
    /// What holds all points; never empty.
    fn of<'a>(points: impl Iterator<Item = &'a (f64, f64)> + Clone) -> Self {
        let span = |value: fn(&(f64, f64)) -> f64| {
            let finite = points.clone().map(value).filter(|v| v.is_finite());
            let (low, high) =
                finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
            if low > high { (0.0, 1.0) } else { (low, high.max(low + 1e-6)) }
        };
        Self { x: span(|p| p.0), y: span(|p| p.1) }
    }

    /// One metre is as long along x as along y.
    fn equal(self) -> Self {
        let (width, height) = (WIDTH - LEFT - EDGE, HEIGHT - BELOW - EDGE);
        let per_unit = ((self.x.1 - self.x.0) / width).max((self.y.1 - self.y.0) / height).max(1e-6) * 1.05;
        let around = |(low, high): (f64, f64), size: f64| {
            let (middle, half) = (0.5 * (low + high), 0.5 * size * per_unit);
            (middle - half, middle + half)
        };
        Self { x: around(self.x, width), y: around(self.y, height) }
    }

    fn at(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        let share = |v: f64, (low, high): (f64, f64)| (v - low) / (high - low);
        let across = LEFT + share(x, self.x) * (WIDTH - LEFT - EDGE);
        let up = EDGE + (1.0 - share(y, self.y)) * (HEIGHT - BELOW - EDGE);
        (across.is_finite() && up.is_finite()).then_some((across, up))
    }

    /// Lines of the grid with their labels.
    /// Lines with their values, and what they are of.
    fn grid(&self, [along_x, along_y]: [&str; 2]) -> String {
        let mut out = format!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{along_x}</text>\
             <text x=\"{:.1}\" y=\"{:.1}\">{along_y}</text>",
            WIDTH - EDGE,
            HEIGHT - BELOW - 6.0,
            LEFT + 6.0,
            EDGE + 14.0
        );
        for k in 0..=5 {
            let share = f64::from(k) / 5.0;
            let value = |(low, high): (f64, f64)| low + share * (high - low);
            let (x, y) = (value(self.x), value(self.y));
            let (Some((across, _)), Some((_, up))) = (self.at((x, y)), self.at((x, y))) else { continue };
            let (right, bottom) = (WIDTH - EDGE, HEIGHT - BELOW);
            let _ = write!(
                out,
                "<path d=\"M{across:.1} {EDGE}V{bottom}M{LEFT} {up:.1}H{right}\" stroke=\"#e1e5e9\" fill=\"none\"/>\
                 <text x=\"{across:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                bottom + 16.0,
                label(x, self.x),
                LEFT - 6.0,
                up + 4.0,
                label(y, self.y)
            );
        }
        out
    }
}

/// A number with the digits that its neighbours need; no minus before nothing.
fn label(value: f64, (low, high): (f64, f64)) -> String {
    let digits = match high - low {
        span if span > 20.0 => 0,
        span if span > 4.0 => 1,
        _ => 2,
    };
    let text = format!("{value:.digits$}");
    if text.chars().all(|c| "-0.".contains(c)) { text.trim_start_matches('-').to_owned() } else { text }
}

fn polyline(axes: &Axes, line: &Line) -> String {
    let points: Vec<String> = (line.points.iter())
        .filter_map(|point| axes.at(*point))
        .map(|(across, up)| format!("{across:.1},{up:.1}"))
        .collect();
    format!(
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.6\"/>",
        points.join(" "),
        line.colour
    )
}

fn figure(what: &str, height: f64, drawn: &str, names: &[(String, &str)]) -> String {
    let entry = |(name, colour): &(String, &str)| {
        format!("<span><i class=\"line\" style=\"background:{colour}\"></i>{}</span>", escaped(name))
    };
    let legend: String = names.iter().map(entry).collect();
    format!(
        "<figure><svg viewBox=\"0 0 {WIDTH} {height}\" role=\"img\" aria-label=\"{}\" font-size=\"12\" \
         font-family=\"sans-serif\">{drawn}</svg><figcaption>{legend}</figcaption></figure>",
        escaped(what)
    )
}

fn names(lines: &[Line]) -> Vec<(String, &str)> {
    lines.iter().map(|line| (line.name.clone(), line.colour)).collect()
}

/// Ways from above, and joins between two places, all in metres to the right and forward.
pub(crate) fn top_view(what: &str, lines: &[Line], joins: &[[[f64; 2]; 2]]) -> String {
    let axes = Axes::of(lines.iter().flat_map(|line| &line.points)).equal();
    let mut drawn = axes.grid(["right, m", "forward, m"]);
    lines.iter().for_each(|line| drawn.push_str(&polyline(&axes, line)));
    for [a, b] in joins {
        let (Some(a), Some(b)) = (axes.at((a[0], a[1])), axes.at((b[0], b[1]))) else { continue };
        let _ = write!(
            drawn,
            "<g class=\"join\" stroke=\"#c00\" fill=\"#fff\" stroke-width=\"2\">\
             <path d=\"M{:.1} {:.1}L{:.1} {:.1}\"/><circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"4\"/>\
             <circle cx=\"{:.1}\" cy=\"{:.1}\" r=\"4\"/></g>",
            a.0, a.1, b.0, b.1, a.0, a.1, b.0, b.1
        );
    }
    let mut names = names(lines);
    if !joins.is_empty() {
        names.push(("join that holds".into(), "#c00"));
    }
    figure(what, HEIGHT, &drawn, &names)
}

/// Lines over time, from nothing upwards.
pub(crate) fn chart(what: &str, titles: [&str; 2], lines: &[Line]) -> String {
    let mut axes = Axes::of(lines.iter().flat_map(|line| &line.points));
    axes.y = (0.0, axes.y.1.max(1e-3));
    let mut drawn = axes.grid(titles);
    lines.iter().for_each(|line| drawn.push_str(&polyline(&axes, line)));
    figure(what, HEIGHT, &drawn, &names(lines))
}

/// Rows of spans from 0 to `end`.
pub(crate) fn bars(what: &str, rows: &[BarRow], end: f64) -> String {
    let mut drawn = String::new();
    let across = |at: f64| 2.0 * LEFT + at / end.max(1e-9) * (WIDTH - 2.0 * LEFT - EDGE);
    for (place, row) in rows.iter().enumerate() {
        let top = ROW * place as f64 + 4.0;
        let name: String = row.name.chars().take(14).collect();
        let _ = write!(drawn, "<text x=\"0\" y=\"{:.1}\">{}</text>", top + 11.0, escaped(&name));
        for (from, to) in &row.spans {
            let width = (across(*to) - across(*from)).max(1.0);
            let _ = write!(
                drawn,
                "<rect x=\"{:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"14\" fill=\"{}\"/>",
                across(*from),
                row.colour
            );
        }
    }
    let bottom = ROW * rows.len().max(1) as f64;
    for k in 0..=4 {
        let at = end * f64::from(k) / 4.0;
        let anchor = if k == 4 { "end" } else { "middle" };
        let _ = write!(
            drawn,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{} s</text>",
            across(at),
            bottom + 14.0,
            label(at, (0.0, end))
        );
    }
    figure(what, bottom + ROW, &drawn, &[])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_metre_is_as_long_in_both_directions_and_nothing_is_cut_off() {
        let axes = Axes::of([(0.0, 0.0), (10.0, 1.0)].iter()).equal();
        let [a, b, c] = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)].map(|p| axes.at(p).unwrap());
        assert!(((b.0 - a.0) - (a.1 - c.1)).abs() < 1e-9);
        let (across, up) = axes.at((10.0, 1.0)).unwrap();
        assert!((LEFT..=WIDTH).contains(&across) && (0.0..=HEIGHT).contains(&up));
        assert_eq!(axes.at((f64::NAN, 0.0)), None);
    }

    #[test]
    fn nothing_and_one_point_can_be_drawn() {
        for points in [vec![], vec![(3.0, 3.0)]] {
            let line = || Line { name: "<a>".into(), colour: colour(0), points: points.clone() };
            for drawn in [top_view("x", &[line()], &[]), chart("x", ["s", "kB/s"], &[line()])] {
                assert!(
                    drawn.contains("&lt;a&gt;") && !drawn.contains("NaN") && !drawn.contains("inf"),
                    "{drawn}"
                );
            }
        }
        assert!(bars("x", &[], 0.0).contains("<svg"));
    }

    #[test]
    fn a_span_is_a_bar_of_its_length() {
        let row = BarRow { name: "a".into(), colour: colour(0), spans: vec![(0.0, 5.0), (7.5, 10.0)] };
        let drawn = bars("x", &[row], 10.0);
        let whole = WIDTH - 2.0 * LEFT - EDGE;
        assert_eq!(drawn.matches("<rect").count(), 2);
        for share in [0.5, 0.25] {
            assert!(drawn.contains(&format!("width=\"{:.1}\"", share * whole)), "{drawn}");
        }
    }
}
