//! The seconds from a depth image's first row to its last, estimated while running (method 1.6): what the matches of
//! surfaces do not agree on when the camera's velocity changes.
//!
//! With `e` the residuals of a pair, `J` their change with its pose and `E` that with the readout, both pose and readout
//! are unknown: the pose marginalised,
//!
//! ```text
//! information = sum E^T Omega E - K^T N^-1 K,   gradient = K^T N^-1 g - sum E^T Omega e,   K = sum J^T Omega E.
//! ```

use crate::estimation::colour_model::STATED_SIGMAS;
use crate::estimation::motion_filter::FRAME_S;
use crate::estimation::student::ONE_AXIS;
use serde::{Deserialize, Serialize};
use tessera_geometry::{Matrix6, Vector6};
use tessera_registration::ReadoutSums;

/// A frame's normal equation of the readout, about 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ReadoutRecord {
    /// Inverse variance of the readout that this frame alone would choose, 1/s^2.
    pub information: f64,
    /// The information times that readout, 1/s.
    pub gradient: f64,
}

impl ReadoutRecord {
    /// From the sums of a pair, the normal equations `N x = -g` of its pose, the variance of one match and the readout
    /// in effect; `None` where nothing is measured.
    pub(crate) fn new(
        sums: &ReadoutSums,
        (normal, gradient): (&Matrix6, &Vector6),
        factor: f64,
        readout_s: f64,
    ) -> Option<Self> {
        let coupling = Vector6::from(sums.coupling);
        let alone = normal.cholesky()?.solve(&coupling);
        let information = (sums.information - coupling.dot(&alone)) / factor;
        let gradient = (alone.dot(gradient) - sums.gradient) / factor;
        (information > 0.0).then_some(Self { information, gradient: gradient + information * readout_s })
    }
}

/// What is known of the readout.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct ReadoutState(ReadoutRecord);

impl ReadoutState {
    /// Before the first frame, of a camera file.
    pub(crate) fn stated(readout_s: f64) -> Self {
        let stated = || 1.0 / (STATED_SIGMAS[0] * STATED_SIGMAS[0]);
        let information = if readout_s == 0.0 { unknown() } else { stated() };
        Self(ReadoutRecord { information, gradient: information * readout_s })
    }

    /// Takes a frame's equation in; what was seen before counts less by `forgetting`, down to the prior.
    pub(crate) fn apply(&mut self, record: &ReadoutRecord, forgetting: f64) {
        // A record may come from elsewhere.
        if !(record.information > 0.0 && record.information.is_finite() && record.gradient.is_finite()) {
            return;
        }
        let [value, sigma] = self.estimate();
        let own = record.gradient / record.information;
        let squared = (own - value).powi(2) / (1.0 / record.information + sigma * sigma);
        let weight = ONE_AXIS.consistent_weight(squared);
        let Self(sum) = self;
        sum.information += forgetting * (unknown() - sum.information) + weight * record.information;
        sum.gradient += weight * record.gradient - forgetting * sum.gradient;
    }

    /// Its value with its standard deviation, seconds.
    pub(crate) fn estimate(&self) -> [f64; 2] {
        [self.0.gradient / self.0.information, libm::sqrt(1.0 / self.0.information)]
    }
}

/// Information of a readout of which nothing is known, 1/s^2: from nothing to the time of a frame, evenly, about 0.
fn unknown() -> f64 {
    3.0 / (FRAME_S * FRAME_S)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_that_agree_lead_to_their_readout_and_one_that_does_not_hardly_moves_it() {
        let of = |readout_s: f64| ReadoutRecord { information: 1e5, gradient: 1e5 * readout_s };
        let mut state = ReadoutState::stated(0.0);
        (0..40).for_each(|_| state.apply(&of(0.03), 0.01));
        let [found_s, sigma_s] = state.estimate();
        assert!((found_s - 0.03).abs() < 0.001 && sigma_s < 0.001, "{found_s} +- {sigma_s} s");
        state.apply(&of(-0.2), 0.01);
        assert!((state.estimate()[0] - found_s).abs() < sigma_s);
        for wrong in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
            let before = state;
            state.apply(&ReadoutRecord { information: wrong, gradient: 1.0 }, 0.01);
            state.apply(&ReadoutRecord { information: 1.0, gradient: wrong / 0.0 }, 0.01);
            assert_eq!(state, before);
        }
    }
}
