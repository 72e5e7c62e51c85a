//! Colours of plots.

use plotters::style::RGBColor;

/// Colours that stay apart in print and for the colour-blind (Okabe and Ito).
pub(crate) const BLUE: RGBColor = RGBColor(0, 114, 178);
/// As [`BLUE`].
pub(crate) const VERMILION: RGBColor = RGBColor(213, 94, 0);
/// As [`BLUE`].
pub(crate) const GREEN: RGBColor = RGBColor(0, 158, 115);
/// As [`BLUE`].
pub(crate) const PURPLE: RGBColor = RGBColor(190, 100, 150);
/// As [`BLUE`].
pub(crate) const ORANGE: RGBColor = RGBColor(230, 159, 0);
/// As [`BLUE`].
pub(crate) const SKY: RGBColor = RGBColor(86, 180, 233);
/// For what stands behind.
pub const GREY: RGBColor = RGBColor(150, 150, 150);
/// For stages and runs, one after the other.
pub const CYCLE: [RGBColor; 6] = [BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY];

/// Colour of the n-th stage or run.
pub fn cycled(place: usize) -> RGBColor {
    CYCLE.iter().cycle().nth(place).copied().unwrap_or(GREY)
}
