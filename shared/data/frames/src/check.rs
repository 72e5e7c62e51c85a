//! Check of a source before it is run.

use crate::{FrameBuffers, Pairing, Source, SourceError};
use serde::Serialize;
use tessera_geometry::Camera;

/// Depths that a room can have, metres; a median outside means wrong units.
const POSSIBLE_M: std::ops::RangeInclusive<f64> = 0.1..=15.0;

/// Broken images that are named one by one.
const MOST_NAMED: usize = 5;

/// Depth over a few frames.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthSummary {
    /// Frames looked at.
    pub frames: Vec<u64>,
    /// Frames among them without a single measurement.
    pub empty_frames: Vec<u64>,
    /// Median depth in metres; absent where nothing was measured.
    pub median_m: Option<f64>,
    /// Share of pixels with a measurement, 0 to 1.
    pub valid_share: f64,
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

/// Intervals between frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Gaps {
    /// Median interval, seconds.
    pub median_interval_s: f64,
    /// Intervals of more than one and a half times the median.
    pub n_gaps: usize,
    /// Longest interval, seconds.
    pub longest_s: f64,
    /// Frame before the longest interval.
    pub longest_after_frame: u64,
}

/// What `tessera check` reports.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CheckReport {
    /// What was recognised and chosen: layout, streams, topics, camera.
    pub description: Vec<(&'static str, String)>,
    /// Number of frames; absent for a source without an end.
    pub n_frames: Option<u64>,
    /// Frames of which an image is missing or broken.
    pub broken_frames: Vec<u64>,
    /// Intrinsics.
    pub camera: Camera,
    /// Field of view from the first to the last column, degrees.
    pub horizontal_fov_deg: f64,
    /// Field of view from the first to the last row, degrees.
    pub vertical_fov_deg: f64,
    /// Depth over the frames looked at.
    pub depth: DepthSummary,
    /// Depth images.
    pub n_depth: usize,
    /// Colour images.
    pub n_colour: usize,
    /// Depth images with a colour image within 0.02 s.
    pub n_pairs: usize,
    /// Largest difference of paired times, seconds.
    pub largest_pair_difference_s: f64,
    /// First to last frame, seconds.
    pub duration_s: f64,
    /// Intervals between frames.
    pub gaps: Gaps,
    /// Poses of the ground truth; 0 where there is none.
    pub ground_truth_poses: usize,
    /// Share of the frames whose time lies inside the ground truth's, 0 to 1.
    pub ground_truth_share: f64,
    /// What looks wrong, in sentences.
    pub warnings: Vec<String>,
}

/// Looks at every image of the source from outside, at `n_samples` frames spread over it in full, at
/// all of its times, and its camera.
///
/// # Errors
/// The frames cannot be read at all.
pub fn check(source: &dyn Source, n_samples: u64) -> Result<CheckReport, SourceError> {
    let camera = source.camera().clone();
    let n_frames = source.n_frames();
    let stamps: Vec<i64> = (0..n_frames.unwrap_or(0)).map_while(|index| source.stamp_nanos(index)).collect();
    let duration_nanos = stamps.last().unwrap_or(&0) - stamps.first().unwrap_or(&0);
    let Pairing { n_depth, n_colour, n_pairs, largest_difference_nanos } = source.pairing();
    let inside_truth = |stamp: &&i64| {
        source.ground_truth().is_some_and(|truth| match truth.stamps_nanos.as_slice() {
            [first, .., last] => (first..=last).contains(stamp),
            _ => false,
        })
    };
    let middle = (f64::from(camera.height - 1) / 2.0, f64::from(camera.width - 1) / 2.0);
    let (broken_frames, mut broken) = broken(source, n_frames.unwrap_or(0));
    let mut report = CheckReport {
        description: source.description(),
        n_frames,
        broken_frames,
        horizontal_fov_deg: angle_deg(&camera, (middle.0, 0.0), (middle.0, 2.0 * middle.1)),
        vertical_fov_deg: angle_deg(&camera, (0.0, middle.1), (2.0 * middle.0, middle.1)),
        camera,
        depth: summarise_depth(source, n_samples)?,
        n_depth,
        n_colour,
        n_pairs,
        largest_pair_difference_s: largest_difference_nanos as f64 * 1e-9,
        duration_s: duration_nanos as f64 * 1e-9,
        gaps: gaps(&stamps),
        ground_truth_poses: source.ground_truth().map_or(0, tessera_evaluation::Trajectory::len),
        ground_truth_share: stamps.iter().filter(inside_truth).count() as f64 / stamps.len().max(1) as f64,
        warnings: Vec::new(),
    };
    report.warnings = source.warnings().to_vec();
    report.warnings.extend_from_slice(source.doubts());
    report.warnings.append(&mut broken);
    report.warnings.extend(warnings(&report));
    Ok(report)
}

/// Frames with an image that is missing or broken, and sentences on the first of them.
fn broken(source: &dyn Source, n_frames: u64) -> (Vec<u64>, Vec<String>) {
    let problems: Vec<(u64, SourceError)> =
        (0..n_frames).filter_map(|index| source.inspect(index).err().map(|error| (index, error))).collect();
    let mut sentences: Vec<String> =
        problems.iter().take(MOST_NAMED).map(|(_, error)| error.to_string()).collect();
    if problems.len() > MOST_NAMED {
        sentences.push(format!("{} frames in all have an image that is missing or broken", problems.len()));
    }
    (problems.into_iter().map(|(index, _)| index).collect(), sentences)
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
            (_, None | Some(SourceError::Colour(_))) => seen.add(index, &depth),
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
}

impl Default for Depths {
    fn default() -> Self {
        Self { histogram: vec![0; 1 << 16], frames: Vec::new(), empty_frames: Vec::new(), n_seen: 0 }
    }
}

impl Depths {
    fn add(&mut self, index: u64, depth_raw: &[u16]) {
        let mut is_empty = true;
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
        DepthSummary {
            median_m: median(&self.histogram, n_valid).map(|raw| raw as f64 / camera.units_per_metre),
            valid_share: n_valid as f64 / self.n_seen.max(1) as f64,
            frames: self.frames,
            empty_frames: self.empty_frames,
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
    let better =
        [1000.0, 5000.0, 10_000.0, 256.0].into_iter().find(|units| (0.4..=8.0).contains(&(raw / units)));
    let hint = better.map_or(String::new(), |units| {
        format!(" (units_per_metre = {units} would make it {:.2} m)", raw / units)
    });
    Err(DepthUnitsError { median_m, units_per_metre: camera.units_per_metre, hint })
}

/// Depths that rooms seen by a depth camera have in the median, metres; outside the units are doubtful.
const USUAL_M: std::ops::RangeInclusive<f64> = 0.45..=4.5;
/// Depth units of cameras and data sets, a metre.
const USUAL_UNITS: [f64; 4] = [1000.0, 5000.0, 10_000.0, 256.0];
/// What the median is in most recordings, metres.
const TYPICAL_M: f64 = 1.5;

/// What speaks against the depth units: a median that is possible and unusual, with the usual units
/// that would bring it nearest to 1.5 m. Says nothing of table-top scans and halls that are just
/// that: it is a doubt, not a proof.
pub fn doubt_units(depth: &DepthSummary, camera: &Camera) -> Option<String> {
    let median_m =
        depth.median_m.filter(|median| !USUAL_M.contains(median) && POSSIBLE_M.contains(median))?;
    let units = camera.units_per_metre;
    let raw = median_m * units;
    let off = |units: f64| (raw / units / TYPICAL_M).max(TYPICAL_M * units / raw);
    let likely = USUAL_UNITS.into_iter().min_by(|a, b| off(*a).total_cmp(&off(*b)))?;
    let hint = match (likely - units).abs() < 0.1 * units {
        true => String::new(),
        false => format!("; units_per_metre = {likely} would make it {:.2} m", raw / likely),
    };
    Some(format!(
        "median depth is {median_m:.2} m with units_per_metre = {units}, unusual for a depth camera{hint}"
    ))
}

fn median(histogram: &[u64], n: u64) -> Option<usize> {
    let mut below = 0;
    histogram.iter().position(|count| {
        below += count;
        n > 0 && 2 * below >= n
    })
}

fn angle_deg(camera: &Camera, from: (f64, f64), to: (f64, f64)) -> f64 {
    let (a, b) = (camera.ray(from.0, from.1), camera.ray(to.0, to.1));
    libm::atan2(a.cross(&b).norm(), a.dot(&b)) * 180.0 / std::f64::consts::PI
}

fn gaps(stamps_nanos: &[i64]) -> Gaps {
    let intervals: Vec<i64> = stamps_nanos.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mut sorted = intervals.clone();
    sorted.sort_unstable();
    let Some(&median) = sorted.get(sorted.len() / 2) else { return Gaps::default() };
    // The first of several longest ones.
    let longest = (0..intervals.len()).rev().max_by_key(|&at| intervals[at]).unwrap_or(0);
    Gaps {
        median_interval_s: median as f64 * 1e-9,
        n_gaps: intervals.iter().filter(|&&interval| 2 * interval > 3 * median).count(),
        longest_s: intervals[longest] as f64 * 1e-9,
        longest_after_frame: longest as u64,
    }
}

fn warnings(report: &CheckReport) -> Vec<String> {
    let mut warnings = Vec::new();
    let mut warn = |holds: bool, sentence: String| {
        if holds {
            warnings.push(sentence);
        }
    };
    let camera = &report.camera;
    let depth = &report.depth;
    match depth.median_m {
        None => warn(true, format!("no depth in any of the {} frames looked at", depth.frames.len())),
        Some(median_m) => {
            warn(
                !POSSIBLE_M.contains(&median_m),
                format!("median depth is {median_m:.3} m: no room is like that, the depth units look wrong"),
            );
            let doubt = doubt_units(depth, camera);
            warn(doubt.is_some(), doubt.unwrap_or_default());
            for frame in &depth.empty_frames {
                warn(true, format!("frame {frame} has no depth in any pixel"));
            }
            let share = depth.valid_share;
            warn(share < 0.4, format!("only {:.0} % of the pixels have depth", 100.0 * share));
        }
    }
    for (name, fov_deg) in [("horizontal", report.horizontal_fov_deg), ("vertical", report.vertical_fov_deg)]
    {
        let sentence = format!(
            "{name} field of view is {fov_deg:.1} degrees: do focal length and image size belong together?"
        );
        warn(!(25.0..=130.0).contains(&fov_deg), sentence);
    }
    for (name, centre, side) in [("cx", camera.cx, camera.width), ("cy", camera.cy, camera.height)] {
        let off = (centre / f64::from(side) - 0.5).abs();
        warn(off > 0.2, format!("{name} is {centre}, far from the middle of {side} px"));
    }
    let ratio = (camera.fx / camera.fy).abs();
    warn(!(0.8..=1.25).contains(&ratio), format!("fx / fy is {ratio:.2}: pixels are rarely that oblong"));
    let unpaired = report.n_depth - report.n_pairs;
    warn(
        report.n_colour > 0 && 10 * unpaired > report.n_depth,
        format!("{unpaired} of {} depth images have no colour image within 0.02 s", report.n_depth),
    );
    let gaps = &report.gaps;
    warn(
        gaps.n_gaps > 0 && gaps.longest_s > 3.0 * gaps.median_interval_s,
        format!(
            "{} gaps between frames, the longest {:.3} s after frame {} (median {:.3} s)",
            gaps.n_gaps, gaps.longest_s, gaps.longest_after_frame, gaps.median_interval_s
        ),
    );
    warn(
        report.ground_truth_poses > 0 && report.ground_truth_share < 0.9,
        format!(
            "ground truth spans the times of only {:.0} % of the frames",
            100.0 * report.ground_truth_share
        ),
    );
    warnings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FrameInfo;
    use tessera_evaluation::Trajectory;

    /// Constant depth in all pixels, one frame every 0.1 s but for a pause.
    struct Flat {
        camera: Camera,
        raw: u16,
    }

    impl Source for Flat {
        fn camera(&self) -> &Camera {
            &self.camera
        }
        fn n_frames(&self) -> Option<u64> {
            Some(20)
        }
        fn stamp_nanos(&self, index: u64) -> Option<i64> {
            let pause = if index > 7 { 900_000_000 } else { 0 };
            (index < 20).then_some(index as i64 * 100_000_000 + pause)
        }
        fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
            buffers.depth.fill(self.raw);
            buffers.depth[0] = 0;
            buffers.depth[1] = u16::MAX;
            let stamp_nanos = self.stamp_nanos(index).unwrap_or(0);
            Ok(FrameInfo { stamp_nanos, has_colour: false, rotation: None })
        }
        fn ground_truth(&self) -> Option<&Trajectory> {
            None
        }
        fn pairing(&self) -> Pairing {
            Pairing { n_depth: 20, n_colour: 3, ..Pairing::default() }
        }
    }

    fn flat(raw: u16, units_per_metre: f64) -> Flat {
        let camera = Camera {
            width: 64,
            height: 48,
            fx: 52.5,
            fy: 52.5,
            cx: 31.5,
            cy: 23.5,
            units_per_metre,
            distortion: [0.0; 5],
            readout_s: 0.0,
            depth_offset_m: 0.0,
            colour_registered: true,
        };
        Flat { camera, raw }
    }

    #[test]
    fn a_report_holds_what_was_asked_for() {
        let report = check(&flat(2000, 1000.0), 5).unwrap();
        assert_eq!(report.depth.median_m, Some(2.0));
        assert_eq!(report.depth.frames, [0, 4, 8, 12, 16]);
        assert!((report.depth.valid_share - 3070.0 / 3072.0).abs() < 1e-12);
        assert!((report.horizontal_fov_deg - 61.93).abs() < 0.01, "{}", report.horizontal_fov_deg);
        assert_eq!((report.gaps.n_gaps, report.gaps.longest_after_frame), (1, 7));
        assert!((report.gaps.longest_s - 1.0).abs() < 1e-12);
        let text = report.warnings.join("\n");
        assert!(text.contains("1 gaps between frames, the longest 1.000 s after frame 7"), "{text}");
        assert!(text.contains("20 of 20 depth images have no colour image"), "{text}");
    }

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
    fn units_that_are_five_times_off_are_doubted_with_the_likely_ones() {
        let doubt = |raw, units| {
            let source = flat(raw, units);
            doubt_units(&summarise_depth(&source, 3).unwrap(), source.camera())
        };
        assert_eq!((doubt(1858, 1000.0), doubt(5630, 5000.0), doubt(943, 1000.0)), (None, None, None));
        let kitchen = doubt(1858, 5000.0).unwrap();
        assert!(
            kitchen.contains("0.37 m with units_per_metre = 5000") && kitchen.contains("1000 would"),
            "{kitchen}"
        );
        let tum = doubt(5630, 1000.0).unwrap();
        assert!(
            tum.contains("5.63 m") && tum.contains("units_per_metre = 5000 would make it 1.13 m"),
            "{tum}"
        );
        assert!(doubt(17_900, 2000.0).unwrap().contains("units_per_metre = 10000 would"));
    }

    #[test]
    fn frames_without_depth_are_warned_of_and_not_refused() {
        for raw in [0, u16::MAX] {
            let source = flat(raw, 1000.0);
            let report = check(&source, 2).unwrap();
            assert_eq!((report.depth.median_m, report.depth.valid_share), (None, 0.0));
            assert!(report.warnings.join("\n").contains("no depth in any of the 2 frames"));
            assert_eq!(refuse_impossible_depth(&report.depth, source.camera(), false), Ok(()));
        }
    }
}
