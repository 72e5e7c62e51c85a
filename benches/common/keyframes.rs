//! Keyframes of the simulated house, slightly off, with a request to optimise them.

use rayon::prelude::*;
use std::ops::Range;
use tessera_geometry::{Pose, PoseBits, Twist, exp};
use tessera_offline::Method;
use tessera_slam::Ferns;
use tessera_slam::{
    AlignRecord, AppliedCorrection, Context, FrameRecord, KeyframeRecord, KeyframeSurfaces, MapChange,
    Optimiser, PoseRecord, RequestRecord,
};
use tessera_sources::{SceneName, SimulatedSource, SimulationOptions, Source};
use tessera_surface::{SurfaceView, Vertex};

/// Frames between two keyframes.
const SPACING: u64 = 6;

/// Surfaces of the keyframes of one way round; the next round sees the same.
pub(crate) struct Surfaces(Vec<Vec<Vertex>>);

impl KeyframeSurfaces for Surfaces {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.0[keyframe as usize % self.0.len()]
    }
}

/// Keyframes with their surfaces.
pub(crate) struct Map {
    context: Context,
    frames: Vec<FrameRecord>,
    pub(crate) surfaces: Surfaces,
}

/// `n` keyframes, in as many rounds through the house as they need.
pub(crate) fn map(n: u64) -> Map {
    let source = SimulatedSource::open(SceneName::House, None, None, &SimulationOptions::default())
        .expect("the house opens");
    let method = Method::default();
    let context = Context::new(source.camera(), &method.surface, &method.registration, &method.mapping);
    let truth = source.ground_truth().expect("a simulated scene has a ground truth");
    let n_of_a_round = truth.poses.len() as u64 / SPACING;
    let surfaces: Vec<Vec<Vertex>> = (0..n.min(n_of_a_round))
        .into_par_iter()
        .map(|k| crate::common::surface(source.camera(), &method, &crate::common::read(&source, k * SPACING)))
        .collect();
    let ferns = Ferns::default();
    let record = |id: u64| {
        let vertices = &surfaces[id as usize % surfaces.len()];
        let frame_index = id * SPACING;
        let pose = truth.poses[0].inverse() * truth.poses[frame_index as usize % truth.poses.len()];
        let surface = SurfaceView { grid: context.grid, vertices };
        frame(id as u32, frame_index, &shaken(id as usize, &pose), ferns.code(&surface))
    };
    let frames = (0..n).map(record).collect();
    Map { context, frames, surfaces: Surfaces(surfaces) }
}

impl Map {
    /// An optimiser that holds all keyframes, and the request to optimise them once.
    pub(crate) fn optimiser(&self) -> (Optimiser, RequestRecord) {
        let mut optimiser = Optimiser::new(self.context.clone());
        let (n, n_frames) = (self.frames.len(), self.frames.len() as u64 * SPACING);
        self.take(&mut optimiser, 0..n, None);
        let request = RequestRecord { is_final: true, ..request(0, n) };
        optimiser.apply(&AlignRecord::End { n_frames, request: Some(request) });
        (optimiser, request)
    }

    /// An optimiser that corrected all keyframes but the last `n_new`, has lived on, and is asked again with those: they
    /// close loops with what it knows.
    pub(crate) fn corrected_optimiser(&self, n_new: usize) -> (Optimiser, RequestRecord) {
        let mut optimiser = Optimiser::new(self.context.clone());
        let n = self.frames.len();
        let first = request(0, n - n_new);
        self.take(&mut optimiser, 0..n - n_new, Some(first));
        let solved = optimiser.solve(&first, &self.surfaces, &[].as_slice(), &mut || ()).expect("pending");
        let applied = AppliedCorrection {
            before_frame: first.effective_before,
            correction: solved.correction().clone(),
        };
        optimiser.apply_own(&solved);
        optimiser.apply(&AlignRecord::Correction(Box::new(applied)));
        let second = request(1, n);
        self.take(&mut optimiser, n - n_new..n, Some(second));
        (optimiser, second)
    }

    /// Keyframes, the last with a request.
    fn take(&self, optimiser: &mut Optimiser, keyframes: Range<usize>, request: Option<RequestRecord>) {
        let last = keyframes.end - 1;
        for id in keyframes {
            let mut frame = self.frames[id].clone();
            frame.change.request = request.filter(|_| id == last);
            optimiser.apply(&AlignRecord::Frame(Box::new(frame)));
        }
    }
}

fn request(request: u64, n: usize) -> RequestRecord {
    let effective_before = n as u64 * SPACING;
    RequestRecord { request, n_keyframes: n as u32, effective_before, is_final: false }
}

/// Two millimetres and a tenth of a degree off, this way and that.
fn shaken(id: usize, pose: &Pose) -> Pose {
    let mut twist = Twist::default();
    twist.rho.x = 0.002 * ((id % 3) as f64 - 1.0);
    twist.phi.y = 0.002 * ((id % 4) as f64 - 1.5);
    pose * exp(&twist)
}

fn frame(id: u32, index: u64, pose: &Pose, place: Vec<u8>) -> FrameRecord {
    let world_from_camera = PoseBits::from(pose);
    let stamp_nanos = index as i64 * 33_333_333;
    let new_keyframe = Some(KeyframeRecord::new(id, (index, stamp_nanos), world_from_camera, place));
    FrameRecord {
        index,
        stamp_nanos,
        pose: PoseRecord { world_from_camera, keyframe: id, ..PoseRecord::default() },
        change: MapChange { new_keyframe, ..MapChange::default() },
        ..FrameRecord::default()
    }
}
