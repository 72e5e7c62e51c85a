//! The steps in which a triangulating sensor counts depth: disparity is counted in steps of equal size, so
//! those of depth grow with its square, and their size is that of the sensor: `step = q depth^2`.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    clippy::cast_possible_truncation,
    reason = "a histogram of all 65,536 raw values, and medians of lists that are not empty"
)]

use serde::Serialize;

/// Ratio of both ends of a window of depth in which the steps are taken to be equal.
const WINDOW: f64 = 1.15;
/// Values that a window needs to have, each by so many pixels: derived, 5 gaps tell their mean to 10 %.
const LEAST_VALUES: usize = 6;
const LEAST_PIXELS: u64 = 3;
/// Mean step of a window, raw counts, from which on rounding to whole counts does not hide it.
const LEAST_STEP: f64 = 4.0;
/// Share of the gaps of a window that may be further than half a step from the median one.
const MOST_ODD: f64 = 0.3;
/// Windows that must agree, and within which share of each other.
const LEAST_WINDOWS: usize = 3;
const MOST_SPREAD: f64 = 0.04;

/// Steps of depth that grow with its square.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Lattice {
    /// Step over the square of depth, per raw count.
    pub q_per_raw: f64,
    /// Share by which it differs between windows of depth.
    pub spread: f64,
}

/// The steps of depth from a histogram by raw value; `None` where there are none, or they grow otherwise.
pub fn depth_lattice(histogram: &[u64]) -> Option<Lattice> {
    let mut found = Vec::new();
    let mut low = 16.0_f64;
    while low * WINDOW < histogram.len() as f64 {
        let window = low as usize..(low * WINDOW) as usize;
        found.extend(step_over_square(histogram, window));
        low *= WINDOW;
    }
    if found.len() < LEAST_WINDOWS {
        return None;
    }
    found.sort_by(f64::total_cmp);
    let median = found[found.len() / 2];
    let mut off: Vec<f64> = found.iter().map(|q| (q / median - 1.0).abs()).collect();
    off.sort_by(f64::total_cmp);
    let spread = off[off.len() * 3 / 4];
    (spread < MOST_SPREAD).then_some(Lattice { q_per_raw: median, spread })
}

fn step_over_square(histogram: &[u64], window: std::ops::Range<usize>) -> Option<f64> {
    let values: Vec<usize> = window.filter(|&raw| histogram[raw] >= LEAST_PIXELS).collect();
    if values.len() < LEAST_VALUES {
        return None;
    }
    // Normalised by the square of depth: inside a window steps differ by a third.
    let mut gaps: Vec<f64> = values
        .windows(2)
        .map(|pair| {
            let middle = 0.5 * (pair[0] + pair[1]) as f64;
            (pair[1] - pair[0]) as f64 / (middle * middle)
        })
        .collect();
    gaps.sort_by(f64::total_cmp);
    let median = gaps[gaps.len() / 2];
    // Gaps of more than one step are values that no pixel had.
    let is_one = |gap: &&f64| (**gap / median - 1.0).abs() < 0.5;
    let one: Vec<&f64> = gaps.iter().filter(is_one).collect();
    let n_odd = gaps.len() - one.len();
    let mean = one.iter().copied().sum::<f64>() / one.len() as f64;
    let middle = values[values.len() / 2] as f64;
    let is_regular = n_odd as f64 <= MOST_ODD * gaps.len() as f64 && mean * middle * middle >= LEAST_STEP;
    is_regular.then_some(mean)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn histogram(units: f64, steps: bool) -> Vec<u64> {
        let mut histogram = vec![0; 1 << 16];
        // A Kinect: disparity of 580 px times 0.075 m, in steps of an eighth of a pixel.
        for disparity in 80..400 {
            let raw = (580.0 * 0.075 * 8.0 / f64::from(disparity) * units).round();
            if raw < 65_000.0 {
                histogram[raw as usize] = 50;
            }
        }
        if !steps {
            histogram[400..5000].fill(9);
        }
        histogram
    }

    #[test]
    fn that_of_a_kinect_is_found_in_any_units() {
        for units in [1000.0, 5000.0, 10_000.0] {
            let found = depth_lattice(&histogram(units, true)).unwrap();
            assert!((found.q_per_raw * units / 0.002_874 - 1.0).abs() < 0.01, "{units}: {found:?}");
        }
    }

    #[test]
    fn a_sensor_without_steps_has_none() {
        assert_eq!(depth_lattice(&histogram(1000.0, false)), None);
        assert_eq!(depth_lattice(&vec![0; 1 << 16]), None);
        let mut even = vec![0; 1 << 16];
        (0..6500).for_each(|k| even[10 * k] = 9);
        assert_eq!(depth_lattice(&even), None, "even steps are not a square's");
    }
}
