//! Keyframes of the simulated house, slightly off, with a request to optimise them.

use rayon::prelude::*;
use tessera_geometry::{Pose, PoseBits, Twist, exp};
use tessera_offline::Method;
use tessera_slam::Ferns;
use tessera_slam::{
    AlignRecord, Context, FrameRecord, KeyframeRecord, KeyframeSurfaces, MapChange, Optimiser, PoseRecord,
    RequestRecord, StoreSlot,
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

/// An optimiser that holds `n` keyframes, in as many rounds through the house as they need, and the
/// request to optimise them once.
pub(crate) fn optimiser(n: u64) -> (Optimiser, RequestRecord, Surfaces) {
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
    let mut optimiser = Optimiser::new(context.clone());
    let ferns = Ferns::default();
    for id in 0..n as usize {
        let vertices = &surfaces[id % surfaces.len()];
        let frame_index = id as u64 * SPACING;
        let pose = truth.poses[0].inverse() * truth.poses[frame_index as usize % truth.poses.len()];
        let surface = SurfaceView { grid: context.grid, vertices };
        let record = frame(id as u32, frame_index, &shaken(id, &pose), ferns.code(&surface));
        optimiser.apply(&AlignRecord::Frame(Box::new(record)));
    }
    let n_frames = n * SPACING;
    let n_keyframes = n as u32;
    let request = RequestRecord { request: 0, n_keyframes, effective_before: n_frames, is_final: true };
    optimiser.apply(&AlignRecord::End { n_frames, request: Some(request) });
    (optimiser, request, Surfaces(surfaces))
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
    let new_keyframe = Some(KeyframeRecord {
        id,
        frame_index: index,
        stamp_nanos,
        world_from_camera,
        velocity: [0.0; 6],
        slot: StoreSlot::default(),
        edges: Vec::new(),
        place,
        alike: Vec::new(),
        retires: Vec::new(),
    });
    FrameRecord {
        index,
        stamp_nanos,
        pose: PoseRecord { world_from_camera, keyframe: id, ..PoseRecord::default() },
        change: MapChange { new_keyframe, ..MapChange::default() },
        ..FrameRecord::default()
    }
}
