//! The camera as a further unknown of the final optimisation.

use crate::map::context::Context;
use crate::map::records::LoopVerdict;
use crate::map::state::KeyframeState;
use crate::map::submaps::Origin;
use crate::map::surfaces::KeyframeSurfaces;
use crate::optimise::global::Solution;
use crate::settings::GlobalSettings;
use std::collections::BTreeSet;
use tessera_calibration::{
    Calibration, CalibrationError, CalibrationKeyframe, PairLimits, Problem, calibrate,
};
use tessera_geometry::{Twist, Vector6};

/// Neighbours of a keyframe: what a camera does to a surface is small, so many pairs are asked.
const NEIGHBOURS: usize = 24;
/// Queries of a pair.
const QUERIES_PER_PAIR: usize = 600;
/// How far the camera may be off, pixels of image motion.
const START_PX: f64 = 8.0;

/// Solves for the camera together with the poses of all keyframes, from the optimised poses on. Of
/// submaps that are apart, the component with most keyframes says what the camera is.
///
/// # Errors
/// Too little overlap, or a solution that is not a camera.
pub(crate) fn refine_camera(
    context: &Context,
    keyframes: &[KeyframeState],
    surfaces: &dyn KeyframeSurfaces,
    solution: &Solution,
    progress: &mut dyn FnMut(),
) -> Result<Calibration, CalibrationError> {
    let limits = PairLimits {
        distance_m: GlobalSettings::RADIUS_M,
        angle_rad: GlobalSettings::ANGLE_DEG.to_radians(),
        neighbours: GlobalSettings::NEIGHBOURS.max(NEIGHBOURS),
    };
    let origins = solution.submaps.origins(keyframes);
    let main = largest(&origins);
    let chains = chains(&origins);
    let refused: BTreeSet<(u32, u32)> = solution
        .loops
        .iter()
        .filter(|l| l.verdict != LoopVerdict::Accepted)
        .map(|l| (l.newer, l.older))
        .collect();
    let mut pairs = tessera_calibration::pairs(&solution.poses, &chains, &limits);
    pairs.retain(|&(query, target)| origins[query].component == main && origins[target].component == main);
    pairs.retain(|&(query, target)| !refused.contains(&(keyframes[query].id, keyframes[target].id)));
    let keyframes: Vec<CalibrationKeyframe<'_>> = keyframes
        .iter()
        .zip(&solution.poses)
        .map(|(k, pose)| CalibrationKeyframe {
            frame_index: k.frame_index,
            world_from_camera: *pose,
            velocity: Twist::from_vector(&Vector6::from_column_slice(&k.velocity)),
            vertices: surfaces.vertices(k.id),
        })
        .collect();
    calibrate(
        &Problem {
            made_with: &context.camera,
            start: &context.camera,
            grid: context.grid,
            offset_px: context.offset_px,
            noise: context.noise,
            registration: &context.registration,
            keyframes: &keyframes,
            pairs: &pairs,
            queries_per_pair: QUERIES_PER_PAIR,
            first_distance_m: GlobalSettings::FIRST_DISTANCE_M,
            min_overlap: GlobalSettings::MIN_OVERLAP,
            start_px: START_PX,
            fixed: &[],
        },
        progress,
    )
}

/// The component with most keyframes; the older of two.
fn largest(origins: &[Origin]) -> u32 {
    let n_in = |component: u32| origins.iter().filter(|o| o.component == component).count();
    let components: BTreeSet<u32> = origins.iter().map(|o| o.component).collect();
    components.into_iter().rev().max_by_key(|component| n_in(*component)).unwrap_or(0)
}

/// A number for each keyframe that is that of the keyframe before it where both are of one run and submap.
fn chains(origins: &[Origin]) -> Vec<u32> {
    let mut chain = 0;
    let number = |place: usize| {
        chain += u32::from(place > 0 && origins[place] != origins[place - 1]);
        chain
    };
    (0..origins.len()).map(number).collect()
}
