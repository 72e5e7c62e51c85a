//! Calibration of a whole sequence: the pipeline with the present camera, then the camera with all
//! keyframes, again until the camera stays.

use crate::focal_of_features::focal_of_features;
use crate::motion::{Moment, velocity};
use crate::smooth_surfaces::SmoothSurfaces;
use crate::{Method, RawFrame, Records, Run, SavedMap};
use std::collections::BTreeSet;
use tessera_calibration::{
    Calibration, CalibrationError, CalibrationKeyframe, PairLimits, Parameter, Problem,
};
use tessera_features::FocalRatio;
use tessera_geometry::{Camera, Pose, Twist, Vector6};
use tessera_numerics::SettingError;
use tessera_slam::{AlignRecord, Context, GlobalSettings, State};
use tessera_sources::judge::{FocalEvidence, FocalPosterior, judge_focal};

/// The camera stays when a pass moves the image by less than this share of its standard deviation,
const CONVERGED_SHARE: f64 = 0.5;
/// or by less than this, pixels.
const CONVERGED_PX: f64 = 0.05;

/// How thorough a calibration is.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrateOptions {
    /// Passes over the sequence at most.
    pub max_passes: u32,
    /// How far the start may be off, pixels of image motion.
    pub start_px: f64,
    /// Parameters that keep their start.
    pub fixed: Vec<Parameter>,
    /// Neighbours of a keyframe.
    pub neighbours: u32,
    /// Queries of a pair.
    pub queries_per_pair: usize,
}

impl Default for CalibrateOptions {
    fn default() -> Self {
        Self { max_passes: 3, start_px: 8.0, fixed: Vec::new(), neighbours: 24, queries_per_pair: 1500 }
    }
}

/// One pass over the sequence, as it went.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pass {
    /// Frames processed.
    pub n_frames: usize,
    /// Frames whose state was not tracking.
    pub n_untracked: usize,
    /// Keyframes made.
    pub n_keyframes: usize,
    /// Root mean square normal residual of the keyframes before and after, standard deviations.
    pub residual_sigmas: (f64, f64),
    /// How far the image moved, pixels.
    pub moved_px: f64,
}

/// A sequence's calibration.
#[derive(Clone, Debug)]
pub struct Calibrated {
    /// The last pass's solution.
    pub calibration: Calibration,
    /// All passes.
    pub passes: Vec<Pass>,
    /// The last pass moved the image by less than the limit.
    pub is_converged: bool,
    /// The focal length by surfaces and features together, over the start's; absent where features do not
    /// determine it, and then it is that of the surfaces.
    pub focal: Option<FocalPosterior>,
}

/// Why there is no calibration.
#[derive(Debug, thiserror::Error)]
pub enum CalibrateError<E> {
    /// A frame could not be read.
    #[error(transparent)]
    Frame(E),
    /// A setting is out of range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// Too much of the sequence was lost.
    #[error(
        "{n_tracked} of {n_frames} frames were tracked with the camera fx {fx:.2}, expected at least half"
    )]
    Lost {
        /// Frames tracked.
        n_tracked: usize,
        /// Frames processed.
        n_frames: usize,
        /// Focal length of the camera that was tried.
        fx: f64,
    },
    /// The frames do not determine a camera.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// Calibrates from frames `0, 1, 2, …` until `read` gives `None`; `progress` is told after each frame
/// and each iteration of the solver.
///
/// # Errors
/// A frame that cannot be read, a sequence that cannot be tracked, or too little to go by.
pub fn calibrate<E>(
    start: &Camera,
    method: &Method,
    options: &CalibrateOptions,
    read: &mut dyn FnMut(u64) -> Result<Option<RawFrame>, E>,
    progress: &mut dyn FnMut(),
) -> Result<Calibrated, CalibrateError<E>> {
    let mut camera = start.clone();
    let mut passes = Vec::new();
    let mut options = options.clone();
    let is_free = !options.fixed.contains(&Parameter::Fx);
    let mut held: Option<FocalPosterior> = None;
    loop {
        let mut run = Run::new(&camera, method)?;
        let mut smooth = SmoothSurfaces::new(&camera, method)?;
        let mut n_frames = 0;
        while let Some(frame) = read(n_frames).map_err(CalibrateError::Frame)? {
            run.push(&frame);
            smooth.push(&frame, &run);
            n_frames += 1;
            progress();
        }
        let colour = run.colour().model;
        let (records, map) = run.finish_with_map();
        let (calibration, n_untracked) =
            solve(&records, &map, &smooth, (&camera, start), method, &options, progress)?;
        passes.push(Pass {
            n_frames: n_frames as usize,
            n_untracked,
            n_keyframes: calibration.world_from_camera.len(),
            residual_sigmas: calibration.residual_sigmas,
            moved_px: calibration.moved_px,
        });
        // The first pass is for the lens, for which features have no other word than its focal length.
        let focal = (is_free && held.is_none() && passes.len() > 1)
            .then(|| focal_of_features(&camera, &map, method, colour))
            .flatten()
            .and_then(|seen| focal_by_all(start, &camera, &calibration, seen));
        camera = calibration.camera.clone();
        // As far as it is certain; the next pass begins there.
        (camera.colour_lag_s, camera.colour_focal_ratio) = (colour.lag_s, colour.focal_ratio);
        let is_last = passes.len() >= options.max_passes as usize;
        let is_converged = calibration.moved_px < (CONVERGED_SHARE * calibration.std_px).max(CONVERGED_PX);
        let asks_features = is_free && held.is_none() && (passes.len() == 1 || focal.is_some());
        if is_last || is_converged && !asks_features {
            let mut calibration = Calibration { camera, ..calibration };
            if let Some(held) = &held {
                state_deviation(&mut calibration, held.sigma / held.ratio);
            }
            return Ok(Calibrated { calibration, passes, is_converged, focal: held });
        }
        if let Some(focal) = focal {
            // The other parameters follow about the focal length of all evidence.
            let aspect = camera.fy / camera.fx;
            camera.fx = start.fx * focal.ratio;
            camera.fy = aspect * camera.fx;
            options.fixed.retain(|fixed| !matches!(fixed, Parameter::Fx | Parameter::Fy));
            options.fixed.extend([Parameter::Fx, Parameter::Fy]);
            held = Some(focal);
        }
    }
}

/// The focal length over the start's by surfaces, which were solved for, and by features, seen with `camera`.
fn focal_by_all(
    start: &Camera,
    camera: &Camera,
    calibration: &Calibration,
    seen: FocalRatio,
) -> Option<FocalPosterior> {
    let of_start = camera.fx / start.fx;
    let fx = calibration.estimates.iter().find(|estimate| estimate.parameter == Parameter::Fx)?;
    let surfaces = FocalEvidence::surfaces(fx.value / start.fx, Some(fx.std / fx.value));
    let features = FocalEvidence::features(seen.ratio * of_start, seen.sigma * of_start, seen.n_pairs);
    judge_focal(&[surfaces, features])
}

/// The deviation of the focal lengths by all evidence, as a share of them.
fn state_deviation(calibration: &mut Calibration, share: f64) {
    for estimate in &mut calibration.estimates {
        if matches!(estimate.parameter, Parameter::Fx | Parameter::Fy) {
            (estimate.std, estimate.held) = (share * estimate.value.abs(), 0.0);
        }
    }
}

fn solve<E>(
    records: &Records,
    map: &SavedMap,
    smooth: &SmoothSurfaces,
    (camera, start): (&Camera, &Camera),
    method: &Method,
    options: &CalibrateOptions,
    progress: &mut dyn FnMut(),
) -> Result<(Calibration, usize), CalibrateError<E>> {
    let n_frames = records.frames().count();
    let n_tracked = n_frames - records.n_untracked();
    if n_tracked * 2 < n_frames || n_frames == 0 {
        return Err(CalibrateError::Lost { n_tracked, n_frames, fx: camera.fx });
    }
    let context = Context::new(camera, &method.surface, &method.registration, &method.mapping);
    let states = &map.keyframes;
    let last = records.last();
    let frames: Vec<Moment> = records
        .frames()
        .zip(&last.poses)
        .map(|(frame, pose)| Moment {
            index: frame.index,
            stamp_nanos: frame.stamp_nanos,
            is_tracked: frame.state == State::Tracking,
            world_from_camera: *pose,
        })
        .collect();
    let keyframes: Vec<CalibrationKeyframe<'_>> = states
        .iter()
        .zip(&smooth.keyframes)
        .map(|(k, vertices)| CalibrationKeyframe {
            frame_index: k.frame_index,
            world_from_camera: Pose::from(&k.world_from_camera),
            velocity: velocity(&frames, k.frame_index)
                .unwrap_or(Twist::from_vector(&Vector6::from_column_slice(&k.velocity))),
            vertices,
        })
        .collect();
    let poses: Vec<Pose> = keyframes.iter().map(|k| k.world_from_camera).collect();
    let limits = PairLimits {
        distance_m: GlobalSettings::RADIUS_M,
        angle_rad: GlobalSettings::ANGLE_DEG.to_radians(),
        neighbours: options.neighbours as usize,
    };
    let refused = refused_pairs(records);
    let mut pairs = tessera_calibration::pairs(&poses, &vec![0; poses.len()], &limits);
    pairs.retain(|pair| !refused.contains(pair));
    let calibration = tessera_calibration::calibrate(
        &Problem {
            made_with: camera,
            start,
            grid: context.grid,
            offset_px: context.offset_px,
            noise: context.noise,
            registration: &method.registration,
            keyframes: &keyframes,
            pairs: &pairs,
            queries_per_pair: options.queries_per_pair,
            first_distance_m: GlobalSettings::FIRST_DISTANCE_M,
            min_overlap: tessera_slam::GlobalSettings::MIN_OVERLAP,
            start_px: options.start_px,
            fixed: &options.fixed,
        },
        progress,
    )?;
    Ok((calibration, n_frames - n_tracked))
}

/// Loop pairs that the last correction gave no weight.
fn refused_pairs(records: &Records) -> BTreeSet<(usize, usize)> {
    let last = records.records.iter().rev().find_map(|record| match record {
        AlignRecord::Correction(applied) => Some(&applied.correction.loops),
        _ => None,
    });
    let loops = last.into_iter().flatten().filter(|l| l.weight == 0.0);
    loops.map(|l| (l.newer as usize, l.older as usize)).collect()
}
