//! The first table as a picture: RPE over the columns, a line for each sequence.

use super::columns::Group;
use super::table::Tables;
use plotters::prelude::*;
use std::error::Error;

/// Width and height, pixels.
const SIZE: (u32, u32) = (960, 480);
/// Colours that stay apart in print and for the colour-blind (Okabe and Ito).
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];

/// The plot as SVG: points of one group are joined, the spread over seeds stands as a bar.
///
/// # Errors
/// What the drawing library says.
pub fn svg(tables: &Tables) -> Result<String, Box<dyn Error>> {
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        area.fill(&WHITE)?;
        draw(tables, &area)?;
        area.present()?;
    }
    Ok(text)
}

fn draw(
    tables: &Tables,
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
) -> Result<(), Box<dyn Error>> {
    let n_columns = tables.columns.len();
    // Logarithmic: the columns of a sequence differ by factors.
    let cells = || tables.rows.iter().flat_map(|r| &r.cells).filter(|c| c.rpe_m_per_s.least > 0.0);
    let least = cells().map(|c| c.rpe_m_per_s.least).fold(f64::INFINITY, f64::min).clamp(1e-6, 1.0);
    let most = cells().map(|c| c.rpe_m_per_s.most).fold(least, f64::max).min(1e3);
    let font = ("sans-serif", 14);
    let mut chart = ChartBuilder::on(area)
        .caption("RPE of the initial alignments, m/s", ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(48)
        .y_label_area_size(64)
        .build_cartesian_2d(-0.5..n_columns as f64 - 0.5, (0.7 * least..1.4 * most).log_scale())?;
    let head = |x: &f64| {
        let place = x.round();
        let is_column = (x - place).abs() < 1e-6 && (0.0..n_columns as f64).contains(&place);
        if is_column { tables.columns[place as usize].name.clone() } else { String::new() }
    };
    chart
        .configure_mesh()
        .disable_x_mesh()
        .x_labels(2 * n_columns + 1)
        .x_label_formatter(&head)
        .y_label_formatter(&|y| format!("{y:.3}"))
        .x_desc(
            "n: pairwise, every n-th pixel; k: pairwise n = 4, filter over k rings; w: window, n = 4, k = 4",
        )
        .label_style(font)
        .light_line_style(BLACK.mix(0.08))
        .draw()?;
    for (place, row) in tables.rows.iter().enumerate() {
        let colour = COLOURS[place % COLOURS.len()];
        for group in [Group::Pairwise, Group::Filter, Group::Window] {
            let points: Vec<(f64, f64)> = (0..n_columns)
                .filter(|&k| tables.columns[k].group == group)
                .map(|k| (k as f64, row.cells[k].rpe_m_per_s.median))
                .collect();
            chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
        }
        let spreads = row.cells.iter().enumerate().map(|(k, cell)| {
            let (x, s) = (k as f64, cell.rpe_m_per_s);
            PathElement::new(vec![(x, s.least), (x, s.most)], colour.stroke_width(1))
        });
        chart.draw_series(spreads)?;
        let dots = row
            .cells
            .iter()
            .enumerate()
            .map(|(k, cell)| Circle::new((k as f64, cell.rpe_m_per_s.median), 4, colour.filled()));
        chart
            .draw_series(dots)?
            .label(&row.sequence)
            .legend(move |(x, y)| Circle::new((x + 8, y), 4, colour.filled()));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(BLACK.mix(0.3))
        .label_font(font)
        .draw()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::table::tests::tables;
    use super::*;

    #[test]
    fn the_plot_names_sequences_and_columns_and_has_a_dot_for_each_cell() {
        let text = svg(&tables(&[("fr1_rpy_400", [0.04; 11]), ("room", [0.01; 11])])).unwrap();
        assert!(text.starts_with("<svg") && text.trim_end().ends_with("</svg>"), "{text}");
        for word in ["fr1_rpy_400", "room", "n = 1", "n = 4", "k = 3", "w = 5"] {
            assert!(text.contains(word), "no {word} in {text}");
        }
        // Eleven cells and the legend, for each of two sequences.
        assert_eq!(text.matches("<circle").count(), 24);
    }
}
