//! A loop with so much drift that the poses do not show it.

use rayon::prelude::*;
use tessera_geometry::{Pose, PoseBits, Twist, exp, translation_rotation_norms};
use tessera_offline::Method;
use tessera_slam::{
    AlignRecord, Context, Ferns, FrameRecord, KeyframeRecord, KeyframeSurfaces, MapChange, Optimiser,
    PlaceCode, PoseRecord, RequestRecord, similarity,
};
use tessera_sources::{FrameBuffers, SceneName, SimulatedSource, SimulationOptions, Source};
use tessera_surface::{Reconstructor, SurfaceView, Vertex};

struct Surfaces(Vec<Vec<Vertex>>);

impl KeyframeSurfaces for Surfaces {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.0[keyframe as usize]
    }
}

/// Frames between two keyframes: six degrees of the room.
const SPACING: u64 = 6;
const N_FRAMES: u64 = 360;

/// Largest error after an optimisation from drifted poses, metres, and loops that count.
fn solved(is_recognised: bool) -> (f64, usize) {
    let source = SimulatedSource::open(SceneName::Room, None, None, &SimulationOptions::default()).unwrap();
    let method = Method::default();
    let context = Context::new(source.camera(), &method.surface, &method.registration, &method.mapping);
    let n = (source.camera().width * source.camera().height) as usize;
    // Once round, and on into what has been seen.
    let indices: Vec<u64> = (0..N_FRAMES)
        .step_by(SPACING as usize)
        .chain((N_FRAMES + 3..N_FRAMES + 40).step_by(SPACING as usize))
        .collect();
    let surfaces: Vec<Vec<Vertex>> = indices
        .par_iter()
        .map(|index| {
            let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
            let mut buffers = FrameBuffers { depth: &mut depth, colour: &mut colour };
            source.read(index % N_FRAMES, &mut buffers).unwrap();
            let mut reconstructor = Reconstructor::new(source.camera(), &method.surface).unwrap();
            let mut vertices = vec![Vertex::default(); reconstructor.grid().len()];
            reconstructor.reconstruct(&depth, Some(&colour), &mut vertices);
            vertices
        })
        .collect();
    let all = &source.ground_truth().unwrap().poses;
    let truth: Vec<Pose> = indices.iter().map(|i| all[0].inverse() * all[(i % N_FRAMES) as usize]).collect();
    let mut drift = Twist::default();
    drift.rho.x = 0.035;
    drift.phi.y = 0.009;
    let drifted: Vec<Pose> =
        truth.iter().enumerate().map(|(k, pose)| exp(&drift.scaled(k as f64)) * pose).collect();
    let worst = translation_rotation_norms(&(truth[truth.len() - 1].inverse() * drifted[truth.len() - 1]));
    assert!(worst.0 > 1.0, "drift of {} m", worst.0);

    let mut optimiser = Optimiser::new(context.clone());
    let ferns = Ferns::default();
    let codes: Vec<PlaceCode> =
        surfaces.iter().map(|vertices| ferns.code(&SurfaceView { grid: context.grid, vertices })).collect();
    for (id, (index, pose)) in indices.iter().zip(&drifted).enumerate() {
        let alike = if is_recognised { most_alike(&indices, &codes, id) } else { None };
        let alike = alike.into_iter().collect();
        optimiser.apply(&AlignRecord::Frame(Box::new(frame(id as u32, *index, pose, alike))));
    }
    let request = RequestRecord {
        request: 0,
        n_keyframes: indices.len() as u32,
        effective_before: N_FRAMES + 41,
        is_final: true,
    };
    optimiser.apply(&AlignRecord::End { n_frames: N_FRAMES + 41, request: Some(request) });
    let correction = optimiser.solve(&request, &Surfaces(surfaces), &[].as_slice(), &mut || ()).unwrap();
    let correction = correction.into_correction();
    let largest = correction.keyframes.iter().zip(&truth).map(|(corrected, truth)| {
        translation_rotation_norms(&(truth.inverse() * Pose::from(&corrected.world_from_camera))).0
    });
    let n_loops = correction.loops.iter().filter(|l| l.weight > 0.9).count();
    (largest.fold(0.0, f64::max), n_loops)
}

#[test]
fn a_loop_that_drift_hides_is_recognised_by_its_looks() {
    let (without, n_without) = solved(false);
    let (with, n_with) = solved(true);
    assert!(n_with >= 3 && n_without == 0, "{n_with} loops, {n_without} without recognition");
    assert!(with < 0.5 * without, "{with} m, {without} m without recognition");
}

/// The keyframe of long before that looks most like one, as the tracker would name it.
fn most_alike(indices: &[u64], codes: &[PlaceCode], newer: usize) -> Option<u32> {
    let settings = Method::default().mapping.loops;
    let closes_loop = |older: &usize| {
        indices[newer] - indices[*older] > settings.min_frames
            && newer - older > tessera_slam::LoopSettings::MIN_KEYFRAMES as usize
    };
    let alike = (0..newer).filter(closes_loop).map(|older| (similarity(&codes[newer], &codes[older]), older));
    let best = alike.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (best.0 >= settings.min_similarity).then_some(best.1 as u32)
}

fn frame(id: u32, index: u64, pose: &Pose, alike: Vec<u32>) -> FrameRecord {
    let world_from_camera = PoseBits::from(pose);
    let stamp_nanos = index as i64 * 33_333_333;
    let keyframe = KeyframeRecord {
        alike,
        ..KeyframeRecord::new(id, (index, stamp_nanos), world_from_camera, Vec::new())
    };
    FrameRecord {
        index,
        stamp_nanos,
        pose: PoseRecord { world_from_camera, keyframe: id, ..PoseRecord::default() },
        change: MapChange { new_keyframe: Some(keyframe), ..MapChange::default() },
        ..FrameRecord::default()
    }
}
