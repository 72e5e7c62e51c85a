//! How colour lies against depth, estimated while running: time lag, ratio of focal lengths, and the rigid
//! transform between the cameras; and whether colour is trusted.
//!
//! The parameters are the maximum of their posterior ([`crate::features::colour_pose`] gives the likelihood); each
//! group of them is applied where its own deviation tells that it is not zero.

use crate::features::colour_pose::{N_PARAMETERS, ParameterMatrix, ParameterSums, Parameters};
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use tessera_geometry::Camera;

/// What is applied to the pixels of features.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColourModel {
    /// Seconds by which colour is newer than the depth of the same stamp.
    pub lag_s: f64,
    /// Focal length of colour over that of depth.
    pub focal_ratio: f64,
    /// Centre of the colour camera in the depth camera's frame, metres.
    pub offset_m: [f64; 3],
    /// Rotation vector of the colour camera in the depth camera's frame, radians.
    pub turn_rad: [f64; 3],
}

impl Default for ColourModel {
    fn default() -> Self {
        Self { lag_s: 0.0, focal_ratio: 1.0, offset_m: [0.0; 3], turn_rad: [0.0; 3] }
    }
}

impl ColourModel {
    /// What a camera file states.
    pub fn of_camera(camera: &Camera) -> Self {
        Self { lag_s: camera.colour_lag_s, focal_ratio: camera.colour_focal_ratio, ..Self::default() }
    }

    fn parameters(&self) -> Parameters {
        let [x, y, z] = self.offset_m;
        let [a, b, c] = self.turn_rad;
        Parameters::from([self.lag_s, self.focal_ratio - 1.0, x, y, z, a, b, c])
    }

    fn of_parameters(p: &Parameters) -> Self {
        Self {
            lag_s: p[0],
            focal_ratio: 1.0 + p[1],
            offset_m: [p[2], p[3], p[4]],
            turn_rad: [p[5], p[6], p[7]],
        }
    }

    fn depth_from_colour(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::from(self.turn_rad))
    }

    /// Direction in the depth camera's frame in which the colour camera sees a pixel `[row, column]`.
    pub(crate) fn ray(&self, camera: &Camera, [row, column]: [f64; 2]) -> Vector3<f64> {
        let about = |pixel: f64, centre: f64| (pixel - centre) / self.focal_ratio + centre;
        self.depth_from_colour() * camera.ray(about(row, camera.cy), about(column, camera.cx))
    }

    /// Pixel `[row, column]` of the colour image in which a point of the depth camera's frame is seen, the
    /// motion during the lag left out.
    pub(crate) fn pixel(&self, camera: &Camera, point: &Vector3<f64>) -> Option<[f64; 2]> {
        let seen = self.depth_from_colour().inverse() * (point - Vector3::from(self.offset_m));
        let (row, column) = camera.project(&seen)?;
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
}

/// A frame's normal equations of the parameters, about the parameters themselves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColourPoseRecord {
    /// Upper triangle of the information, row by row.
    information: Vec<f32>,
    gradient: Vec<f32>,
}

impl ColourPoseRecord {
    /// `sums` are about the model in effect.
    pub(crate) fn new(sums: &ParameterSums, model: &ColourModel) -> Self {
        let gradient = sums.gradient + sums.information * model.parameters();
        let triangle = (0..N_PARAMETERS).flat_map(|r| (r..N_PARAMETERS).map(move |c| (r, c)));
        Self {
            information: triangle.map(|place| sums.information[place] as f32).collect(),
            gradient: gradient.iter().map(|v| *v as f32).collect(),
        }
    }

    fn sums(&self) -> Option<ParameterSums> {
        let mut sums = ParameterSums::default();
        let mut numbers = self.information.iter().map(|v| f64::from(*v));
        for r in 0..N_PARAMETERS {
            for c in r..N_PARAMETERS {
                let value = numbers.next()?;
                (sums.information[(r, c)], sums.information[(c, r)]) = (value, value);
            }
        }
        for (k, v) in sums.gradient.iter_mut().enumerate() {
            *v = f64::from(*self.gradient.get(k)?);
        }
        Some(sums)
    }
}

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
/// Share by which what was seen before counts less with each keyframe.
const FORGETTING: f64 = 0.01;
/// Standard deviations before anything is measured: physical bounds of cameras with two lenses (exposures start
/// within a frame of 33 ms; fields of view differ by some tenths; baselines are 15 to 75 mm; factory alignment
/// is within a degree).
const PRIOR_SIGMAS: [f64; N_PARAMETERS] = [0.03, 0.1, 0.03, 0.03, 0.03, 0.01, 0.01, 0.01];
/// Standard deviations of what a camera file states.
const STATED_SIGMAS: [f64; N_PARAMETERS] = [0.001, 0.002, 0.03, 0.03, 0.03, 0.01, 0.01, 0.01];
/// Places of the groups that are applied together: lag, focal ratio, position, rotation.
const GROUPS: [std::ops::Range<usize>; 4] = [0..1, 1..2, 2..5, 5..8];
/// Chi-square beyond which a group is not zero, one in 10^6, by its degrees of freedom 1 and 3.
const CERTAIN_SQ: [f64; 2] = [23.9, 30.7];
/// Chi-square below which it may well be zero, one in 100.
const DOUBTED_SQ: [f64; 2] = [6.6, 11.3];

/// What all frames so far say of colour.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ColourState {
    /// Frames with enough matches.
    pub n_frames: u32,
    /// Sums of the records, older ones less.
    information: ParameterMatrix,
    gradient: Parameters,
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
            information: ParameterMatrix::from_diagonal(&precisions(&PRIOR_SIGMAS)),
            gradient: Parameters::zeros(),
            residual_px: FIRST_RESIDUAL_PX,
            disagreement: FIRST_DISAGREEMENT,
            model: ColourModel::default(),
        }
    }
}

fn precisions(sigmas: &[f64; N_PARAMETERS]) -> Parameters {
    Parameters::from(sigmas.map(|sigma| 1.0 / (sigma * sigma)))
}

impl ColourState {
    /// The state before the first frame: what the camera file states is applied, and the frames go on
    /// from there; where it states nothing, nothing is known.
    pub fn stated(model: ColourModel) -> Self {
        if model == ColourModel::default() {
            return Self::default();
        }
        let precisions = precisions(&STATED_SIGMAS);
        Self {
            information: ParameterMatrix::from_diagonal(&precisions),
            gradient: precisions.component_mul(&model.parameters()),
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
        // The first frames count alike.
        let share = LEAST_SHARE.max(1.0 / (f64::from(self.n_frames) + 1.0));
        self.disagreement += share * (record.disagreement.min(MOST_DISAGREEMENT) - self.disagreement);
        self.residual_px += share * (record.residual_px - self.residual_px);
    }

    /// Takes a frame's normal equations in. The prior is forgotten as all else, and much slower than it is outweighed.
    pub(crate) fn apply_pose(&mut self, record: &ColourPoseRecord) {
        let Some(sums) = record.sums() else { return };
        let prior = ParameterMatrix::from_diagonal(&precisions(&PRIOR_SIGMAS)) * FORGETTING;
        self.information = self.information * (1.0 - FORGETTING) + prior + sums.information;
        self.gradient = self.gradient * (1.0 - FORGETTING) + sums.gradient;
        self.decide();
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

    /// Lag and ratio less one with their standard deviations, `[value, sigma]` each.
    pub fn estimate(&self) -> Option<[[f64; 2]; 2]> {
        let (value, covariance) = self.posterior()?;
        Some([0, 1].map(|k| [value[k], covariance[(k, k)].max(0.0).sqrt()]))
    }

    /// Position of the colour camera in the depth camera's frame, metres, with its standard deviations.
    pub fn offset(&self) -> Option<[[f64; 2]; 3]> {
        let (value, covariance) = self.posterior()?;
        Some([2, 3, 4].map(|k| [value[k], covariance[(k, k)].max(0.0).sqrt()]))
    }

    fn posterior(&self) -> Option<(Parameters, ParameterMatrix)> {
        let factor = self.information.cholesky()?;
        Some((factor.solve(&self.gradient), factor.inverse()))
    }

    fn decide(&mut self) {
        let Some((value, covariance)) = self.posterior() else { return };
        let mut applied = self.model.parameters();
        for group in GROUPS {
            let n = group.len();
            let of = |p: &Parameters| DVector::from_iterator(n, group.clone().map(|k| p[k]));
            let block = DMatrix::from_fn(n, n, |r, c| covariance[(group.start + r, group.start + c)]);
            let Some(factor) = block.cholesky() else { continue };
            let distance = |v: &DVector<f64>| v.dot(&factor.solve(v));
            let (found, before) = (of(&value), of(&applied));
            let place = usize::from(n > 1);
            let is_applied = before.iter().any(|v| *v != 0.0);
            let chosen = match distance(&found) {
                // What is applied moves when it must, not with each keyframe.
                d if is_applied && d >= DOUBTED_SQ[place] => {
                    if distance(&(&found - &before)) > n as f64 { found } else { before }
                }
                d if d > CERTAIN_SQ[place] => found,
                _ => DVector::zeros(n),
            };
            group.zip(chosen.iter()).for_each(|(k, v)| applied[k] = *v);
        }
        self.model = ColourModel::of_parameters(&applied);
    }
}
