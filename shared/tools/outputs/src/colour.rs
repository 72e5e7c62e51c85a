//! How colour lies against depth, as a run found it.

use serde::Serialize;
use tessera_slam::ColourState;

/// Lag and focal ratio of colour against depth, as estimated at the end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ColourSummary {
    /// Seconds by which colour is newer than the depth of the same stamp, with its standard deviation.
    pub colour_lag_s: [f64; 2],
    /// Focal length of colour over that of depth, with its standard deviation.
    pub colour_focal_ratio: [f64; 2],
    /// What was applied at the end: 0 and 1 until an estimate is certain.
    pub applied_lag_s: f64,
    /// As the lag.
    pub applied_focal_ratio: f64,
    /// Seconds from the exposure of the first row to that of the last, with its standard deviation.
    pub readout_s: [f64; 2],
    /// What was applied of it at the end.
    pub applied_readout_s: f64,
    /// Residual of features against the surfaces after the correction, pixels.
    pub residual_px: f64,
    /// Log odds that colour is of the time and place of depth, nats.
    pub own_nats: f64,
    /// Whether they are for it.
    pub is_believed: bool,
}

impl ColourSummary {
    /// `None` where no frame's features could be judged.
    pub fn new(state: &ColourState) -> Option<Self> {
        let [lag, [ratio, ratio_sigma]] = state.estimate().filter(|_| state.n_frames > 0)?;
        Some(Self {
            colour_lag_s: lag,
            colour_focal_ratio: [1.0 + ratio, ratio_sigma],
            applied_lag_s: state.model.lag_s,
            applied_focal_ratio: state.model.focal_ratio,
            readout_s: state.readout_s(),
            applied_readout_s: state.model.readout_s,
            residual_px: state.residual_px,
            own_nats: state.own_nats,
            is_believed: state.is_trusted(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::replay::Replay;
    use crate::test_run;
    use tessera_slam::{ColourModel, ColourPoseRecord, ColourRecord, EvidenceRecord, FrameRecord};

    fn summary(stated: ColourModel, frames: &[FrameRecord]) -> Option<ColourSummary> {
        let mut replay = Replay::default();
        replay.frames = frames.to_vec();
        ColourSummary::new(&replay.colour(stated))
    }

    #[test]
    fn estimates_come_from_the_records_of_all_frames() {
        let frame = test_run::replay().frames[0].clone();
        let none = ColourModel::default();
        assert_eq!(summary(none, std::slice::from_ref(&frame)), None);
        // A lag of 20 ms and a ratio of 0.9, as normal equations.
        let colour = ColourRecord { n_pairs: 100, residual_px: 1.0, nats: 3.0 };
        let pose = ColourPoseRecord { information: [1e8, 0.0, 1e7], gradient: [2e6, -1e6] };
        let evidence =
            EvidenceRecord { colour: Some(colour), colour_pose: Some(pose), ..EvidenceRecord::default() };
        let frames = vec![FrameRecord { evidence, ..frame }; 40];
        let found = summary(none, &frames).unwrap();
        assert!((found.colour_lag_s[0] - 0.02).abs() < 1e-6 && found.colour_lag_s[1] < 1e-3);
        assert!((found.colour_focal_ratio[0] - 0.9).abs() < 1e-6);
        assert!((found.applied_lag_s - 0.02).abs() < 1e-6);
        assert!((found.applied_focal_ratio - 0.9).abs() < 1e-6);
        assert!(found.is_believed && found.own_nats > 5.0);
        let mut foreign = frames[0].clone();
        foreign.evidence.colour = Some(ColourRecord { nats: -3.0, ..colour });
        assert!(!summary(none, &vec![foreign; 10]).unwrap().is_believed);
        // What the camera file states is applied before anything is certain.
        let stated = ColourModel { lag_s: 0.015, focal_ratio: 0.95, readout_s: 0.02 };
        let mut audited = frames[0].clone();
        audited.evidence.colour_pose = None;
        let found = summary(stated, &[audited]).unwrap();
        assert_eq!((found.applied_lag_s, found.applied_focal_ratio), (0.015, 0.95));
        assert_eq!(found.applied_readout_s, 0.02);
    }
}
