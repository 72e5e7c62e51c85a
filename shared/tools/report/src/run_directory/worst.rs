//! Selection of the worst frames.

use crate::{Frame, FrameState, WorstFrame};

/// Frames shown at most.
const MOST: usize = 4;
/// Least time between two of them, seconds, and least share of the whole run.
const APART: (f64, f64) = (1.0, 0.08);

/// The frames that are farthest off; without ground truth those that were lost, and then those of
/// whose place the aligner is least sure.
pub(super) fn pick(frames: &[Frame], has_truth: bool) -> Vec<WorstFrame> {
    let badness = |frame: &Frame| match (has_truth, frame.state) {
        (_, FrameState::Dropped) => None,
        (true, _) => frame.error_m,
        (false, FrameState::Lost) => Some(f64::INFINITY),
        (false, _) => frame.std_m,
    };
    let mut all: Vec<(f64, &Frame)> =
        frames.iter().filter_map(|frame| badness(frame).map(|bad| (bad, frame))).collect();
    // Stable: the first among equals.
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let duration_s = frames.last().map_or(0.0, |frame| frame.time_s);
    let apart_s = APART.0.max(APART.1 * duration_s).min(0.2 * duration_s);
    let mut picked: Vec<&Frame> = Vec::new();
    for (_, frame) in all {
        if picked.len() < MOST && picked.iter().all(|other| (other.time_s - frame.time_s).abs() >= apart_s) {
            picked.push(frame);
        }
    }
    picked
        .into_iter()
        .map(|frame| WorstFrame { index: frame.index, words: words(frame), pictures: Vec::new() })
        .collect()
}

fn words(frame: &Frame) -> String {
    let mut parts = Vec::new();
    if let Some(error_m) = frame.error_m {
        parts.push(format!("{:.1} mm off", 1e3 * error_m));
    }
    if let Some(std_m) = frame.std_m {
        parts.push(format!("standard deviation {:.1} mm", 1e3 * std_m));
    }
    match frame.state {
        FrameState::Tracking | FrameState::Dropped => {}
        FrameState::Lost => parts.push("lost".into()),
        FrameState::Relocalising => parts.push("relocalising".into()),
    }
    if !frame.reason.is_empty() {
        parts.push(frame.reason.clone());
    }
    format!("{:.2} s, {}", frame.time_s, parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(index: u64, error_m: Option<f64>, state: FrameState) -> Frame {
        let std_m = Some(0.001 * index as f64);
        Frame { index, time_s: index as f64 / 30.0, state, error_m, std_m, ..Frame::default() }
    }

    #[test]
    fn peaks_are_taken_and_not_their_neighbours() {
        let error = |k: u64| {
            if k.abs_diff(100) < 5 { 0.5 - 0.01 * k.abs_diff(100) as f64 } else { 0.001 * (k % 7) as f64 }
        };
        let frames: Vec<Frame> = (0..300).map(|k| frame(k, Some(error(k)), FrameState::Tracking)).collect();
        let picked = pick(&frames, true);
        assert_eq!((picked.len(), picked[0].index), (4, 100));
        assert!(picked[0].words.starts_with("3.33 s, 500.0 mm off"), "{}", picked[0].words);
        assert!(picked[1..].iter().all(|worst| worst.index.abs_diff(100) >= 30));
    }

    #[test]
    fn without_truth_lost_frames_come_first() {
        let state = |k| if k == 5 { FrameState::Lost } else { FrameState::Tracking };
        let frames: Vec<Frame> = (0..100).map(|k| frame(k, None, state(k))).collect();
        let picked = pick(&frames, false);
        assert_eq!((picked[0].index, picked[1].index), (5, 99));
        assert!(pick(&[], false).is_empty());
    }
}
