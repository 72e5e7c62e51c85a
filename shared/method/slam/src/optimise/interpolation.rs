//! Interpolates untracked frames between tracked neighbours.

use crate::map::records::{FrameRecord, State};
use std::collections::BTreeMap;
use tessera_geometry::{Pose, PoseBits, compose_normalised, log};

/// When each frame was taken, whether its pose can be trusted, and its reference keyframe.
#[derive(Clone, Debug, Default)]
pub(crate) struct PoseTimeline {
    frames: Vec<(u64, i64, State, u32)>,
}

impl PoseTimeline {
    pub(crate) fn add(&mut self, frame: &FrameRecord) {
        self.frames.push((frame.index, frame.stamp_nanos, frame.state, frame.pose.keyframe));
    }

    /// Poses of the lost frames that have a trusted one before and after: at constant velocity
    /// from one to the other. Frames at either end of the run, or between keyframes of different
    /// components, have no such pose.
    pub(crate) fn interpolated(
        &self,
        known: &BTreeMap<u64, Pose>,
        component: impl Fn(u32) -> Option<u32>,
    ) -> Vec<(u64, PoseBits)> {
        let mut filled = Vec::new();
        let mut before: Option<(i64, Pose, Option<u32>)> = None;
        let mut waiting: Vec<(u64, i64)> = Vec::new();
        for &(index, stamp, state, keyframe) in &self.frames {
            let component = component(keyframe);
            if state == State::Lost {
                waiting.push((index, stamp));
                continue;
            }
            let Some(pose) = known.get(&index) else { continue };
            if let Some((from, start, last)) = before
                && stamp > from
                && component == last
            {
                let step = log(&(start.inverse() * pose));
                filled.extend(waiting.iter().map(|&(index, at)| {
                    let since = |stamp: i64| stamp.saturating_sub(from) as f64;
                    let share = since(at) / since(stamp);
                    (index, PoseBits::from(&compose_normalised(&start, &step.scaled(share))))
                }));
            }
            waiting.clear();
            before = Some((stamp, *pose, component));
        }
        filled
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_is_filled_and_an_open_end_is_not() {
        let states = [State::Lost, State::Tracking, State::Lost, State::Lost, State::Tracking, State::Lost];
        let frames = states.iter().enumerate().map(|(k, s)| (k as u64, k as i64 * 10, *s, 0)).collect();
        let known =
            BTreeMap::from([(1, Pose::translation(1.0, 0.0, 0.0)), (4, Pose::translation(4.0, 0.0, 0.3))]);
        let mut timeline = PoseTimeline { frames };
        let filled = timeline.interpolated(&known, Some);
        assert_eq!(filled.iter().map(|f| f.0).collect::<Vec<_>>(), [2, 3]);
        assert!((filled[0].1.translation_m[0] - 2.0).abs() < 1e-12);
        assert!((filled[1].1.translation_m[2] - 0.2).abs() < 1e-12);
        timeline.frames[4].3 = 1;
        assert_eq!(timeline.interpolated(&known, Some), [], "between submaps");
    }
}
