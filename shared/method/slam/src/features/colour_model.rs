//! How colour lies against depth, estimated while running: time lag and ratio of focal lengths.
//!
//! Both are linear in the residuals of matches between frames whose relative pose is known. Each
//! frame's record holds its normal equations about the parameters themselves, so that the state is
//! their sum; what is applied follows from the state alone.

use nalgebra::{Matrix2, Vector2, Vector3};
use serde::{Deserialize, Serialize};
use tessera_geometry::Camera;

/// What is applied to the pixels of features.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColourModel {
    /// Seconds by which colour is newer than the depth of the same stamp.
    pub lag_s: f64,
    /// Focal length of colour over that of depth.
    pub focal_ratio: f64,
}

impl Default for ColourModel {
    fn default() -> Self {
        Self { lag_s: 0.0, focal_ratio: 1.0 }
    }
}

impl ColourModel {
    /// What a camera file states.
    pub fn of_camera(camera: &Camera) -> Self {
        Self { lag_s: camera.colour_lag_s, focal_ratio: camera.colour_focal_ratio }
    }

    /// Pixel `[row, column]` of the depth image that looks in the direction of a pixel of the colour
    /// image, both without distortion.
    pub(crate) fn pixel_of_depth(&self, camera: &Camera, row: f64, column: f64) -> [f64; 2] {
        [
            (row - camera.cy) / self.focal_ratio + camera.cy,
            (column - camera.cx) / self.focal_ratio + camera.cx,
        ]
    }

    /// Pixel `[row, column]` of the colour image in which a point of the camera's frame is seen, the
    /// motion during the lag left out.
    pub(crate) fn pixel(&self, camera: &Camera, point: &Vector3<f64>) -> Option<[f64; 2]> {
        let (row, column) = camera.project(point)?;
        Some([
            (row - camera.cy) * self.focal_ratio + camera.cy,
            (column - camera.cx) * self.focal_ratio + camera.cx,
        ])
    }
}

/// What one frame's matches say of colour, as journaled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColourRecord {
    /// Matches that took part.
    pub n_pairs: u32,
    /// Median residual of a pair against its surfaces, mean over the pairs, pixels.
    pub residual_px: f64,
    /// What of it no lag and no ratio explains, in units of what is allowed at this motion.
    pub disagreement: f64,
    /// `sum w J^T J`: lag-lag, lag-ratio, ratio-ratio, per square pixel.
    pub information: [f64; 3],
    /// `sum w J^T (J x - r)` at the parameters `x` in effect.
    pub gradient: [f64; 2],
}

/// Share by which what was seen before counts less with each frame.
const FORGETTING: f64 = 0.002;
/// Disagreement from which on colour is not trusted: one's own colour has 0.1 to 0.5, that of another
/// scene 1 to 3.
pub const UNTRUSTED: f64 = 0.85;
/// A frame's disagreement that counts, at most: its surfaces may have gone astray.
const MOST_DISAGREEMENT: f64 = 2.0;
/// Least share that a frame has in the running means.
const LEAST_SHARE: f64 = 0.1;
/// Residual in pixels, and disagreement, before the first frame.
const FIRST_RESIDUAL_PX: f64 = 4.0;
const FIRST_DISAGREEMENT: f64 = 0.4;
/// Matches that count for a frame's residual, at least.
pub(crate) const MIN_PAIRS: u32 = 20;
/// Residual from which on features are no start for the surfaces, pixels.
const VAGUE_PX: f64 = 10.0;
/// Frames in which colour is on probation.
const PROBATION_FRAMES: u32 = 2;
/// Frames before anything is applied.
const MIN_FRAMES: u32 = 10;
/// Matches err together: their number is worth this share.
const INDEPENDENT: f64 = 0.05;
/// A parameter is applied when it differs from none by this many deviations, and is worth it.
const CERTAIN_SIGMAS: f64 = 5.0;
const LEAST_LAG_S: f64 = 0.002;
const LEAST_RATIO: f64 = 0.005;
/// Beyond, it is no such camera.
const MOST_LAG_S: f64 = 0.1;
const MOST_RATIO: f64 = 0.3;

/// What all frames so far say of colour.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColourState {
    /// Frames with enough matches.
    pub n_frames: u32,
    /// Sums of the records, older ones less.
    pub information: [f64; 3],
    /// As the information.
    pub gradient: [f64; 2],
    /// Running residual, pixels.
    pub residual_px: f64,
    /// Running disagreement.
    pub disagreement: f64,
    /// What is applied.
    pub model: ColourModel,
}

impl Default for ColourState {
    fn default() -> Self {
        Self {
            n_frames: 0,
            information: [0.0; 3],
            gradient: [0.0; 2],
            residual_px: FIRST_RESIDUAL_PX,
            disagreement: FIRST_DISAGREEMENT,
            model: ColourModel::default(),
        }
    }
}

/// Standard deviations of what a camera file states.
const STATED_LAG_SIGMA_S: f64 = 0.001;
const STATED_RATIO_SIGMA: f64 = 0.002;

impl ColourState {
    /// The state before the first frame: what the camera file states is applied, and the frames go on
    /// from there; where it states nothing, nothing is known.
    pub fn stated(model: ColourModel) -> Self {
        if model == ColourModel::default() {
            return Self::default();
        }
        // As an estimate with these deviations: see `estimate`.
        let sigmas = [STATED_LAG_SIGMA_S, STATED_RATIO_SIGMA];
        let [lag, ratio] = sigmas.map(|sigma| 1.0 / (INDEPENDENT * sigma * sigma));
        Self {
            information: [lag, 0.0, ratio],
            gradient: [lag * model.lag_s, ratio * (model.focal_ratio - 1.0)],
            model,
            ..Self::default()
        }
    }

    /// The state as of these records, in order of frames.
    pub fn of_records<'a>(stated: ColourModel, records: impl IntoIterator<Item = &'a ColourRecord>) -> Self {
        let mut state = Self::stated(stated);
        records.into_iter().for_each(|record| state.apply(record));
        state
    }

    /// Takes a frame's record in.
    pub(crate) fn apply(&mut self, record: &ColourRecord) {
        if record.n_pairs < MIN_PAIRS {
            return;
        }
        self.n_frames = self.n_frames.saturating_add(1);
        let kept = 1.0 - FORGETTING;
        (0..3).for_each(|k| self.information[k] = kept * self.information[k] + record.information[k]);
        (0..2).for_each(|k| self.gradient[k] = kept * self.gradient[k] + record.gradient[k]);
        // The first frames count alike.
        let share = LEAST_SHARE.max(1.0 / (f64::from(self.n_frames) + 1.0));
        self.disagreement += share * (record.disagreement.min(MOST_DISAGREEMENT) - self.disagreement);
        self.residual_px += share * (record.residual_px - self.residual_px);
        if self.n_frames >= MIN_FRAMES {
            self.decide();
        }
    }

    /// Whether features may lead: otherwise colour is of another time or another scene.
    pub fn is_trusted(&self) -> bool {
        self.disagreement < UNTRUSTED
    }

    /// Whether features are no start where the surfaces suffice: too few frames were judged, and colour
    /// of another scene that leads takes weak surfaces along and is found out late; or colour agrees
    /// with depth too roughly.
    pub(crate) fn is_on_probation(&self) -> bool {
        self.is_trusted() && (self.n_frames < PROBATION_FRAMES || self.residual_px > VAGUE_PX)
    }

    /// Factor of the residuals' information: 1 where colour agrees with the surfaces to a pixel, 0
    /// where it is not trusted.
    pub(crate) fn weight(&self) -> f64 {
        let ratio = 1.0 / self.residual_px.max(1.0);
        if self.is_trusted() { ratio * ratio } else { 0.0 }
    }

    /// Lag and ratio less one with their standard deviations, `[value, sigma]` each.
    pub fn estimate(&self) -> Option<[[f64; 2]; 2]> {
        let [a, b, d] = self.information;
        let inverse = Matrix2::new(a, b, b, d).try_inverse()?;
        let x = inverse * Vector2::from(self.gradient);
        // The residual is that of the pose and the pixel too: never below one.
        let variance = self.residual_px.max(1.0).powi(2) / INDEPENDENT;
        let sigma = |k: usize| (inverse[(k, k)] * variance).max(0.0).sqrt();
        Some([[x[0], sigma(0)], [x[1], sigma(1)]])
    }

    fn decide(&mut self) {
        let Some([lag, ratio]) = self.estimate() else { return };
        let applied = [self.model.lag_s, self.model.focal_ratio - 1.0];
        let chosen = |[value, sigma]: [f64; 2], applied: f64, least: f64, most: f64| {
            let is_certain =
                value.abs() > CERTAIN_SIGMAS * sigma && value.abs() > least && value.abs() < most;
            let is_none = value.abs() < 0.5 * least || value.abs() < 0.5 * CERTAIN_SIGMAS * sigma;
            // What is applied moves when it must, not with each frame.
            let is_off = (value - applied).abs() > 0.25 * least && (value - applied).abs() > 0.5 * sigma;
            match () {
                () if is_certain && (applied == 0.0 || is_off) => value,
                () if is_none => 0.0,
                () => applied,
            }
        };
        self.model.lag_s = chosen(lag, applied[0], LEAST_LAG_S, MOST_LAG_S);
        self.model.focal_ratio = 1.0 + chosen(ratio, applied[1], LEAST_RATIO, MOST_RATIO);
    }
}
