//! What is estimated of the camera while running: time lag and ratio of focal lengths of colour against depth, the
//! readout of both, and whether colour is trusted.
//!
//! The parameters are the maximum of their posterior. Lag and ratio ([`crate::estimation::colour_pose`] gives the
//! likelihood) are applied where their own deviations tell that they are not zero; the readout
//! ([`crate::estimation::readout`]) where they tell that what is applied is wrong.

use crate::estimation::colour_pose::{ColourParameters, ParameterMatrix, ParameterSums};
use crate::estimation::readout::{ReadoutRecord, ReadoutState};
use crate::estimation::{CHI_SQUARE_6, FALSE_ALARMS, FORGETTING};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use tessera_geometry::Camera;

/// Lag and focal ratio as applied to the pixels of features, and the readout.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColourModel {
    /// Seconds by which colour is newer than the depth of the same stamp.
    pub lag_s: f64,
    /// Focal length of colour over that of depth.
    pub focal_ratio: f64,
    /// Seconds from the exposure of the first row to that of the last.
    pub readout_s: f64,
}

impl Default for ColourModel {
    fn default() -> Self {
        Self { lag_s: 0.0, focal_ratio: 1.0, readout_s: 0.0 }
    }
}

impl ColourModel {
    /// The model of a camera file.
    pub fn of_camera(camera: &Camera) -> Self {
        Self {
            lag_s: camera.colour_lag_s,
            focal_ratio: camera.colour_focal_ratio,
            readout_s: camera.readout_s,
        }
    }

    fn parameters(&self) -> ColourParameters {
        ColourParameters::new(self.lag_s, self.focal_ratio - 1.0)
    }

    /// Pixel `[row, column]` of the depth image that looks in the direction of a pixel of the colour
    /// image, both without distortion.
    #[inline(always)]
    pub(crate) fn pixel_of_depth(&self, camera: &Camera, row: f64, column: f64) -> [f64; 2] {
        [
            (row - camera.cy) / self.focal_ratio + camera.cy,
            (column - camera.cx) / self.focal_ratio + camera.cx,
        ]
    }

    /// Pixel `[row, column]` of the colour image in which a point of the camera's frame is seen, the
    /// motion during the lag left out.
    #[inline(always)]
    pub(crate) fn pixel(&self, camera: &Camera, point: &Vector3<f64>) -> Option<[f64; 2]> {
        let (row, column) = camera.project(point)?;
        Some([
            (row - camera.cy) * self.focal_ratio + camera.cy,
            (column - camera.cx) * self.focal_ratio + camera.cx,
        ])
    }
}

/// Audit of colour by one frame's matches, as journaled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColourRecord {
    /// Matches that took part.
    pub n_pairs: u32,
    /// Median residual of a pair against its surfaces, mean over the pairs, pixels.
    pub residual_px: f64,
    /// Log-likelihood ratio of "this image is of its time and place", mean over the pairs, nats.
    pub nats: f64,
}

/// A frame's normal equations of lag and ratio less one, about the parameters themselves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColourPoseRecord {
    /// Lag-lag, lag-ratio and ratio-ratio.
    pub information: [f64; 3],
    /// The information times the parameters that this frame alone would choose.
    pub gradient: [f64; 2],
}

impl ColourPoseRecord {
    /// `sums` are about the model in effect.
    pub(crate) fn new(sums: &ParameterSums, model: &ColourModel) -> Self {
        let gradient = sums.gradient + sums.information * model.parameters();
        let [a, b, _, d] = [0, 1, 2, 3].map(|k| sums.information[k]);
        Self { information: [a, b, d], gradient: gradient.into() }
    }
}

/// What a frame tells of its camera: the audit of its colour, the equations of lag and ratio, and that of the readout.
pub type CameraEvidence<'a> =
    (Option<&'a ColourRecord>, Option<&'a ColourPoseRecord>, Option<&'a ReadoutRecord>);

/// Log odds before the first frame, as if one of four cameras had colour of another time or scene; beyond them colour
/// that was found wrong is believed again.
const FIRST_NATS: f64 = 1.0;
/// Share of a frame's evidence that is its own: those of frames that follow each other correlate by half.
const OWN_SHARE: f64 = 1.0 / 3.0;
/// Residual before the first frame, pixels.
const FIRST_RESIDUAL_PX: f64 = 4.0;
/// A frame's residual counts as this at least, pixels: what corners are found to.
pub(crate) const LEAST_RESIDUAL_PX: f64 = 0.5;
/// One of so many frames is audited, once the first were, and so many audits are in the running mean.
pub(crate) const AUDITED_EVERY: u64 = 8;
/// Standard deviations of lag and ratio before anything is measured: exposures start within a frame of 33 ms,
/// and fields of view of the two lenses differ by some tenths.
const PRIOR_SIGMAS: [f64; 2] = [0.03, 0.1];
/// Standard deviations of what a camera file states: on two recordings of one camera the lag differs by 2 ms.
pub(crate) const STATED_SIGMAS: [f64; 2] = [0.003, 0.005];

/// Colour model and its trust, estimated from all frames so far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColourState {
    /// Frames that were audited.
    pub n_frames: u32,
    /// Sums of the records, older ones less.
    information: [f64; 3],
    gradient: [f64; 2],
    /// What is known of the readout.
    readout: ReadoutState,
    /// Running residual, pixels.
    pub residual_px: f64,
    /// Log odds of "colour is of its time and place", nats.
    pub own_nats: f64,
    /// Whether features may lead.
    is_trusted: bool,
    /// The model as applied.
    pub model: ColourModel,
}

impl Default for ColourState {
    fn default() -> Self {
        Self {
            n_frames: 0,
            information: precisions(PRIOR_SIGMAS),
            gradient: [0.0; 2],
            readout: ReadoutState::stated(0.0),
            residual_px: FIRST_RESIDUAL_PX,
            own_nats: FIRST_NATS,
            is_trusted: true,
            model: ColourModel::default(),
        }
    }
}

fn precisions([lag, ratio]: [f64; 2]) -> [f64; 3] {
    [1.0 / (lag * lag), 0.0, 1.0 / (ratio * ratio)]
}

impl ColourState {
    /// The state before the first frame: what the camera file states is applied, and the frames go on
    /// from there; where it states nothing, nothing is known.
    pub fn stated(model: ColourModel) -> Self {
        let readout = ReadoutState::stated(model.readout_s);
        if (model.lag_s, model.focal_ratio) == (0.0, 1.0) {
            return Self { model, readout, ..Self::default() };
        }
        let information = precisions(STATED_SIGMAS);
        let [lag, _, ratio] = information;
        let gradient = [lag * model.lag_s, ratio * (model.focal_ratio - 1.0)];
        Self { information, gradient, model, readout, ..Self::default() }
    }

    /// The state as of these records of frames, in their order.
    pub fn of_records<'a>(stated: ColourModel, frames: impl IntoIterator<Item = CameraEvidence<'a>>) -> Self {
        let mut state = Self::stated(stated);
        frames.into_iter().for_each(|evidence| state.apply(evidence));
        state
    }

    /// Evidence that a frame's image is of its time, nats: after so many that were, one is not with the probability
    /// of 1 / (n + 2) (Laplace's rule of succession).
    pub(crate) fn image_nats(&self) -> f64 {
        libm::log(f64::from(self.n_frames) + 2.0)
    }

    /// Takes a frame's records in.
    pub(crate) fn apply(&mut self, (audit, pose, readout): CameraEvidence<'_>) {
        if let Some(record) = audit {
            self.apply_audit(record);
        }
        if let Some(record) = pose {
            self.apply_pose(record);
        }
        if let Some(record) = readout {
            self.apply_readout(record);
        }
    }

    /// Takes in how the features of a frame lie against its surfaces.
    pub(crate) fn apply_audit(&mut self, record: &ColourRecord) {
        self.n_frames = self.n_frames.saturating_add(1);
        // The first frames count alike; later on it is the mean of some seconds.
        let share = 1.0 / (f64::from(self.n_frames) + 1.0).min(AUDITED_EVERY as f64);
        // At most as if colour went wrong, or right, in so many frames.
        let most_nats = -libm::log(FALSE_ALARMS);
        self.own_nats = (self.own_nats + OWN_SHARE * record.nats).clamp(-most_nats, most_nats);
        self.is_trusted = self.own_nats > if self.is_trusted { 0.0 } else { FIRST_NATS };
        // The geometric mean: one frame of a blurred turn has ten times the residual of its neighbours.
        let ratio = record.residual_px.max(LEAST_RESIDUAL_PX) / self.residual_px;
        self.residual_px *= libm::pow(ratio, share);
    }

    /// Takes a frame's normal equations in; what was seen before counts less, down to the prior.
    pub(crate) fn apply_pose(&mut self, record: &ColourPoseRecord) {
        let prior = precisions(PRIOR_SIGMAS);
        for k in 0..3 {
            let kept = (1.0 - FORGETTING) * self.information[k] + FORGETTING * prior[k];
            self.information[k] = kept + record.information[k];
        }
        for k in 0..2 {
            self.gradient[k] = (1.0 - FORGETTING) * self.gradient[k] + record.gradient[k];
        }
        self.decide();
    }

    /// Takes a frame's equation of the readout in; what is applied changes where it is off by more than a
    /// standard deviation.
    fn apply_readout(&mut self, record: &ReadoutRecord) {
        self.readout.apply(record, FORGETTING);
        let [value, sigma] = self.readout.estimate();
        if (value - self.model.readout_s).abs() > sigma {
            self.model.readout_s = value;
        }
    }

    /// The readout with its standard deviation, seconds.
    pub fn readout_s(&self) -> [f64; 2] {
        self.readout.estimate()
    }

    /// Whether features may lead: otherwise colour is of another time or another scene.
    pub fn is_trusted(&self) -> bool {
        self.is_trusted
    }

    /// Covariance of lag and ratio before anything is measured: how far a camera's own colour may lie from its depth.
    /// That of the estimate takes velocities as exact, and is no judge.
    pub(crate) fn prior_covariance() -> ParameterMatrix {
        ParameterMatrix::from_diagonal(&PRIOR_SIGMAS.map(|sigma| sigma * sigma).into())
    }

    /// Covariance of lag and ratio.
    fn covariance(&self) -> Option<ParameterMatrix> {
        let [a, b, d] = self.information;
        ParameterMatrix::new(a, b, b, d).try_inverse()
    }

    /// Lag and ratio less one with their standard deviations, `[value, sigma]` each.
    pub fn estimate(&self) -> Option<[[f64; 2]; 2]> {
        let covariance = self.covariance()?;
        let value = covariance * ColourParameters::from(self.gradient);
        Some([0, 1].map(|k| [value[k], covariance[(k, k)].max(0.0).sqrt()]))
    }

    fn decide(&mut self) {
        let Some([lag, ratio]) = self.estimate() else { return };
        self.model.lag_s = chosen(lag, self.model.lag_s);
        self.model.focal_ratio = 1.0 + chosen(ratio, self.model.focal_ratio - 1.0);
    }
}

/// Value of a parameter to apply: it changes when it must, not with each keyframe.
fn chosen([value, sigma]: [f64; 2], applied: f64) -> f64 {
    // Of one dimension it is one in 470,000 that is zero.
    let certain = if applied == 0.0 { CHI_SQUARE_6.sqrt() } else { 1.0 };
    match value.abs() > certain * sigma {
        true if applied != 0.0 && (value - applied).abs() < sigma => applied,
        true => value,
        false => 0.0,
    }
}
