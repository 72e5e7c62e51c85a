//! Depth over some frames, and whether its units can be right.
#![expect(
    clippy::arithmetic_side_effects,
    clippy::indexing_slicing,
    reason = "a histogram of all 65,536 raw values, and counts of pixels in memory"
)]

use crate::along_ray::Bent;
use crate::judge::{Lattice, UnitsEvidence, depth_lattice, judge_units};
use crate::odd_depth::OddDepth;
use crate::{FrameBuffers, Source, SourceError};
use serde::Serialize;
use tessera_geometry::Camera;

/// Depths that a room can have, metres; a median outside means wrong units.
pub(crate) const POSSIBLE_M: std::ops::RangeInclusive<f64> = 0.1..=15.0;

/// Depth units that a refusal proposes, a metre.
const USUAL_UNITS: [f64; 4] = [1000.0, 5000.0, 10_000.0, 256.0];
/// A share of one in so many is nearer than [`DepthSummary::near_m`].
const NEAR_SHARE: u64 = 50;

/// Depth over a few frames.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthSummary {
    /// Frames looked at.
    pub frames: Vec<u64>,
    /// Frames among them without a single measurement.
    pub empty_frames: Vec<u64>,
    /// Median depth in metres; absent where nothing was measured.
    pub median_m: Option<f64>,
    /// Depth that a fiftieth of all is nearer than, metres; absent where nothing was measured.
    pub near_m: Option<f64>,
    /// Steps of depth, where they grow with its square.
    pub lattice: Option<Lattice>,
    /// Share of pixels with a measurement, 0 to 1.
    pub valid_share: f64,
    /// Whether its planes bend.
    #[serde(skip)]
    pub bent: Bent,
    /// Whether these are images that a camera takes.
    #[serde(skip)]
    pub odd: OddDepth,
}

impl DepthSummary {
    /// What speaks against the images, in sentences.
    pub fn doubts(&self) -> Vec<String> {
        self.bent.doubt().into_iter().chain(self.odd.doubts()).collect()
    }
}

/// The median depth is one that no room has: the depth units are wrong.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "median depth is {median_m:.3} m with units_per_metre = {units_per_metre}, expected 0.1 to 15 m: the depth units \
     look wrong{hint}; --force runs it all the same"
)]
pub struct DepthUnitsError {
    /// Median found, metres.
    pub median_m: f64,
    /// The camera's units.
    pub units_per_metre: f64,
    /// Units that would make sense, as text.
    pub hint: String,
}

/// Median depth and share of valid pixels over `n_samples` frames spread over the source; those that
/// cannot be read are passed over.
///
/// # Errors
/// None of the frames can be read.
pub fn summarise_depth(source: &dyn Source, n_samples: u64) -> Result<DepthSummary, SourceError> {
    let camera = source.camera();
    let n_pixels = camera.width as usize * camera.height as usize;
    let (mut depth, mut colour) = (vec![0u16; n_pixels], vec![0u8; 3 * n_pixels]);
    let n_frames = source.n_frames().unwrap_or(n_samples);
    let n_samples = n_samples.min(n_frames);
    let frames: Vec<u64> = (0..n_samples).map(|k| k * n_frames / n_samples).collect();
    let mut seen = Depths::default();
    let mut first_error = None;
    for &index in &frames {
        let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
        match source.read_what_is_there(index, &mut buffers)? {
            (_, None | Some(SourceError::Colour(_))) => {
                seen.add(index, &depth);
                seen.bent.add(&depth, camera);
            }
            (_, Some(error)) => first_error = first_error.or(Some(error)),
        }
    }
    match first_error {
        Some(error) if seen.frames.is_empty() => Err(error),
        _ => Ok(seen.summary(camera)),
    }
}

/// The same for one image that is at hand.
pub fn summarise_image(depth_raw: &[u16], camera: &Camera) -> DepthSummary {
    let mut seen = Depths::default();
    seen.add(0, depth_raw);
    seen.summary(camera)
}

/// Depths of some images, by their raw value.
struct Depths {
    histogram: Vec<u64>,
    frames: Vec<u64>,
    empty_frames: Vec<u64>,
    n_seen: usize,
    bent: Bent,
    odd: OddDepth,
}

impl Default for Depths {
    fn default() -> Self {
        Self {
            histogram: vec![0; 1 << 16],
            frames: Vec::new(),
            empty_frames: Vec::new(),
            n_seen: 0,
            bent: Bent::default(),
            odd: OddDepth::default(),
        }
    }
}

impl Depths {
    fn add(&mut self, index: u64, depth_raw: &[u16]) {
        let mut is_empty = true;
        self.odd.add(index, depth_raw);
        for &raw in depth_raw.iter().filter(|&&raw| raw != 0 && raw != u16::MAX) {
            self.histogram[usize::from(raw)] += 1;
            is_empty = false;
        }
        if is_empty {
            self.empty_frames.push(index);
        }
        self.frames.push(index);
        self.n_seen += depth_raw.len();
    }

    fn summary(self, camera: &Camera) -> DepthSummary {
        let n_valid: u64 = self.histogram.iter().sum();
        let metres = |raw| raw as f64 / camera.units_per_metre;
        DepthSummary {
            median_m: quantile(&self.histogram, n_valid, 2).map(metres),
            near_m: quantile(&self.histogram, n_valid, NEAR_SHARE).map(metres),
            lattice: depth_lattice(&self.histogram),
            valid_share: n_valid as f64 / self.n_seen.max(1) as f64,
            frames: self.frames,
            empty_frames: self.empty_frames,
            bent: self.bent,
            odd: self.odd,
        }
    }
}

/// Refuses a source whose median depth lies outside 0.1 to 15 m, unless forced.
///
/// # Errors
/// The median, the units, and units that would make sense.
pub fn refuse_impossible_depth(
    depth: &DepthSummary,
    camera: &Camera,
    force: bool,
) -> Result<(), DepthUnitsError> {
    let Some(median_m) = depth.median_m else { return Ok(()) };
    if force || POSSIBLE_M.contains(&median_m) {
        return Ok(());
    }
    let raw = median_m * camera.units_per_metre;
    let better = USUAL_UNITS.into_iter().find(|units| (0.4..=8.0).contains(&(raw / units)));
    let of_units =
        better.map(|units| format!("units_per_metre = {units} would make it {:.2} m", raw / units));
    // Another cause explains the values too.
    let hint = match depth.odd.byte_order().or(of_units) {
        Some(words) => format!(" ({words})"),
        None => String::new(),
    };
    Err(DepthUnitsError { median_m, units_per_metre: camera.units_per_metre, hint })
}

/// What speaks against the depth units before a run, where the judge refutes them: a median depth alone
/// never does, for tables and halls are that near and that far.
pub fn doubt_units(depth: &DepthSummary, camera: &Camera) -> Option<String> {
    let (units, median_m) = (camera.units_per_metre, depth.median_m?);
    let evidence = UnitsEvidence {
        stated: units,
        median_m: Some(median_m),
        near_m: depth.near_m,
        lattice: depth.lattice,
        true_scale: None,
    };
    let found = judge_units(&evidence).filter(|found| found.is_wrong)?;
    let steps = if depth.lattice.is_some() { " and its steps" } else { "" };
    Some(format!(
        "depth{steps} is unlike a sensor's with units_per_metre = {units}: {} is likely, a median depth of {:.2} m instead of {median_m:.2} m",
        found.likely_words(),
        median_m * units / found.likely
    ))
}

/// Value that one in `share` of all is not above.
fn quantile(histogram: &[u64], n: u64, share: u64) -> Option<usize> {
    let mut below = 0;
    histogram.iter().position(|count| {
        below += count;
        n > 0 && share * below >= n
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::tests::flat;

    #[test]
    fn wrong_depth_units_are_refused_with_a_hint_unless_forced() {
        let source = flat(10_000, 100.0);
        let depth = summarise_depth(&source, 3).unwrap();
        let message = refuse_impossible_depth(&depth, source.camera(), false).unwrap_err().to_string();
        assert!(
            message.contains("median depth is 100.000 m with units_per_metre = 100, expected 0.1 to 15 m"),
            "{message}"
        );
        assert!(message.contains("units_per_metre = 5000 would make it 2.00 m"), "{message}");
        assert!(message.contains("--force"), "{message}");
        assert_eq!(refuse_impossible_depth(&depth, source.camera(), true), Ok(()));
        let source = flat(500, 10_000.0);
        let depth = summarise_depth(&source, 3).unwrap();
        assert!(refuse_impossible_depth(&depth, source.camera(), false).is_err());
    }

    #[test]
    fn distances_of_a_table_and_of_a_hall_are_not_doubted() {
        let doubt = |raw, units| {
            let source = flat(raw, units);
            doubt_units(&summarise_depth(&source, 3).unwrap(), source.camera())
        };
        for (raw, units) in [(250, 1000.0), (400, 1000.0), (5630, 1000.0), (9000, 1000.0), (1858, 5000.0)] {
            assert_eq!(doubt(raw, units), None, "{raw} of {units}");
        }
    }

    #[test]
    fn units_are_doubted_by_the_steps_of_depth_with_the_likely_ones() {
        let mut raw = Vec::new();
        for disparity in 80..400 {
            // A Kinect with millimetres.
            raw.extend([(580.0 * 0.075 * 8.0 / f64::from(disparity) * 1000.0_f64).round() as u16; 12]);
        }
        let doubt = |units| {
            let camera = Camera::pinhole((640, 6), [525.0, 525.0, 320.0, 3.0], units);
            doubt_units(&summarise_image(&raw, &camera), &camera)
        };
        assert_eq!(doubt(1000.0), None);
        let words = doubt(5000.0).unwrap();
        assert!(
            words.contains("its steps") && words.contains("units_per_metre = 5000: 1000 is likely"),
            "{words}"
        );
        assert!(doubt(200.0).unwrap().contains("1000 is likely"));
    }
}
