//! Check of a source before it is run.

use crate::depth_units::{DepthSummary, POSSIBLE_M, doubt_units, summarise_depth};
use crate::odd_camera::{fields_of_view_deg, odd_camera};
use crate::{Source, SourceError};
use serde::Serialize;
use tessera_geometry::Camera;

/// Broken images that are named one by one.
const MOST_NAMED: usize = 5;

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
    /// From the stamps of depth images to the times at which they were taken, seconds: 0 or negative.
    pub taken_after_s: f64,
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
    let duration_nanos = stamps.last().unwrap_or(&0).saturating_sub(*stamps.first().unwrap_or(&0));
    let pairing = source.pairing();
    let inside_truth = |stamp: &&i64| {
        source.ground_truth().is_some_and(|truth| match truth.stamps_nanos.as_slice() {
            [first, .., last] => (first..=last).contains(stamp),
            _ => false,
        })
    };
    let (broken_frames, mut broken) = broken(source, n_frames.unwrap_or(0));
    let mut report = CheckReport {
        description: source.description(),
        n_frames,
        broken_frames,
        horizontal_fov_deg: fields_of_view_deg(&camera)[0],
        vertical_fov_deg: fields_of_view_deg(&camera)[1],
        camera,
        depth: summarise_depth(source, n_samples)?,
        n_depth: pairing.n_depth,
        n_colour: pairing.n_colour,
        n_pairs: pairing.n_pairs,
        largest_pair_difference_s: pairing.largest_difference_nanos as f64 * 1e-9,
        taken_after_s: pairing.taken_after_nanos as f64 * 1e-9,
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

fn gaps(stamps_nanos: &[i64]) -> Gaps {
    let pairs = stamps_nanos.iter().zip(stamps_nanos.iter().skip(1));
    let intervals: Vec<i64> = pairs.map(|(before, after)| after.saturating_sub(*before)).collect();
    let mut sorted = intervals.clone();
    sorted.sort_unstable();
    let Some(&median) = sorted.get(sorted.len() / 2) else { return Gaps::default() };
    // The first of several longest ones.
    let later = |best: (u64, &i64), next: (u64, &i64)| -> std::cmp::Ordering {
        best.1.cmp(next.1).then(next.0.cmp(&best.0))
    };
    let longest = (0_u64..).zip(&intervals).max_by(|a, b| later(*a, *b));
    let (longest_after_frame, longest) = longest.unwrap_or((0, &0));
    Gaps {
        median_interval_s: median as f64 * 1e-9,
        n_gaps: intervals
            .iter()
            .filter(|interval| interval.saturating_mul(2) > median.saturating_mul(3))
            .count(),
        longest_s: *longest as f64 * 1e-9,
        longest_after_frame,
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
            for doubt in depth.doubts() {
                warn(true, doubt);
            }
            for frame in &depth.empty_frames {
                warn(true, format!("frame {frame} has no depth in any pixel"));
            }
            let share = depth.valid_share;
            warn(share < 0.4, format!("only {:.0} % of the pixels have depth", 100.0 * share));
        }
    }
    for sentence in odd_camera(camera) {
        warn(true, sentence);
    }
    let unpaired = report.n_depth.saturating_sub(report.n_pairs);
    warn(
        report.n_colour > 0 && unpaired.saturating_mul(10) > report.n_depth,
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
pub(crate) mod tests {
    use super::*;
    use crate::Pairing;
    use crate::{FrameBuffers, FrameInfo, refuse_impossible_depth};
    use tessera_evaluation::Trajectory;

    /// Constant depth in all pixels, one frame every 0.1 s but for a pause.
    pub(crate) struct Flat {
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
            Ok(FrameInfo { stamp_nanos, has_colour: false, rotation: None, up: None })
        }
        fn ground_truth(&self) -> Option<&Trajectory> {
            None
        }
        fn pairing(&self) -> Pairing {
            Pairing { n_depth: 20, n_colour: 3, ..Pairing::default() }
        }
    }

    pub(crate) fn flat(raw: u16, units_per_metre: f64) -> Flat {
        let camera = Camera::pinhole((64, 48), [52.5, 52.5, 31.5, 23.5], units_per_metre);
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
