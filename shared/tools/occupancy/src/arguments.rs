//! Options of a grid as words of a command line.

/// The edge of a cell or the distance of points, metres.
///
/// # Errors
/// It is no number from 0.005 to 1.
pub fn parse_cell_m(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|metres| (0.005..=1.0).contains(metres));
    found.ok_or_else(|| "expected 0.005 to 1 m".to_owned())
}

/// A band of heights, metres, as `0.1,1.0`.
///
/// # Errors
/// It is no pair of numbers, or not 0.1 to 3 m high.
pub fn parse_heights_m(text: &str) -> Result<(f64, f64), String> {
    let numbers = text.split_once(',').and_then(|(low, high)| Some((low.parse().ok()?, high.parse().ok()?)));
    let is_band = |(low, high): &(f64, f64)| low.abs() <= 100.0 && (0.1..=3.0).contains(&(high - low));
    numbers.filter(is_band).ok_or_else(|| "expected two heights 0.1 to 3 m apart, such as 0.1,1.0".to_owned())
}
