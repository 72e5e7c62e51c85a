//! TrueViews of a sequence at their true poses, as the keyframes of a map.

use rayon::prelude::*;
use std::error::Error;
use tessera_evaluation::Trajectory;
use tessera_features::Feature;
use tessera_geometry::{Pose, PoseBits, log};
use tessera_offline::RawFrame;
use tessera_settings::Settings;
use tessera_slam::{Context, Ferns, KeyframeState, KeyframeSurfaces, StoreSlot};
use tessera_sources::{SimulationOptions, SourceOptions, SourceSpec};
use tessera_surface::{Reconstructor, SurfaceView, Vertex};

/// What is asked for on the command line.
pub(crate) struct ViewsOptions {
    pub(crate) sequence: String,
    camera: Option<String>,
    simulation: SimulationOptions,
    /// First frames of the parts that are looked at, and the number of frames of each.
    from: Vec<u64>,
    frames: Option<u64>,
    every: u64,
}

impl ViewsOptions {
    pub(crate) fn parse(arguments: &[String]) -> Result<Self, Box<dyn Error>> {
        let (sequence, rest) = arguments.split_first().ok_or("a sequence is needed")?;
        let mut asked = Self {
            sequence: sequence.clone(),
            camera: None,
            simulation: SimulationOptions::default(),
            from: Vec::new(),
            frames: None,
            every: 10,
        };
        for pair in rest.chunks(2) {
            let [name, value] = pair else { return Err(format!("{} needs a value", pair[0]).into()) };
            match name.as_str() {
                "--camera" => asked.camera = Some(value.clone()),
                "--simulation" => asked.simulation = toml::from_str(value)?,
                "--from" => asked.from.push(value.parse()?),
                "--frames" => asked.frames = Some(value.parse()?),
                "--every" => asked.every = value.parse::<u64>()?.max(1),
                other => {
                    return Err(format!(
                        "{other}: expected --camera, --simulation, --from, --frames or --every"
                    )
                    .into());
                }
            }
        }
        if asked.from.is_empty() {
            asked.from.push(0);
        }
        Ok(asked)
    }
}

/// TrueViews as keyframes, with their surfaces and features.
pub(crate) struct TrueViews {
    pub(crate) context: Context,
    pub(crate) keyframes: Vec<KeyframeState>,
    surfaces: Vec<Vec<Vertex>>,
    features: Vec<Vec<Feature>>,
}

impl KeyframeSurfaces for TrueViews {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        &self.surfaces[keyframe as usize]
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        &self.features[keyframe as usize]
    }
}

impl TrueViews {
    pub(crate) fn of(asked: &ViewsOptions) -> Result<Self, Box<dyn Error>> {
        let options = SourceOptions {
            camera: asked.camera.clone(),
            simulation: asked.simulation.clone(),
            ..SourceOptions::default()
        };
        let source = tessera_sources::open(&SourceSpec::parse(&asked.sequence), &options)?;
        let source = source.as_ref();
        let truth = source.ground_truth().ok_or("a sequence with ground truth is needed")?;
        let settings = Settings::default();
        let context =
            Context::new(source.camera(), &settings.surface, &settings.registration, &settings.mapping);
        let mut extractor = settings.mapping.features.extractor(source.camera(), settings.registration.isa);
        let mut reconstructor = Reconstructor::new(source.camera(), &settings.surface)?;
        let grid = reconstructor.grid();
        let ferns = Ferns::default();
        let mut views = Self { context, keyframes: Vec::new(), surfaces: Vec::new(), features: Vec::new() };
        let n_frames = source.n_frames().unwrap_or(0);
        let part = |from: &u64| *from..asked.frames.map_or(n_frames, |n| (from + n).min(n_frames));
        let indices: Vec<u64> =
            asked.from.iter().flat_map(|from| part(from).step_by(asked.every as usize)).collect();
        for some in indices.chunks(16) {
            let read = |index: &u64| RawFrame::read(source, *index);
            let frames: Vec<RawFrame> = some.par_iter().map(read).collect::<Result<_, _>>()?;
            for (index, frame) in some.iter().zip(frames) {
                let Some((pose, velocity)) = motion(truth, frame.stamp_nanos) else { continue };
                let mut vertices = vec![Vertex::default(); grid.len()];
                reconstructor.reconstruct(&frame.depth, frame.colour.as_deref(), &mut vertices);
                let place = ferns.code(&SurfaceView { grid, vertices: &vertices });
                views.keyframes.push(KeyframeState {
                    id: views.keyframes.len() as u32,
                    session: 0,
                    submap: 0,
                    frame_index: *index,
                    stamp_nanos: frame.stamp_nanos,
                    world_from_camera: PoseBits::from(&pose),
                    velocity,
                    slot: StoreSlot::default(),
                    edges: Vec::new(),
                    covariance: Vec::new(),
                    up: None,
                    place,
                    alike: Vec::new(),
                    anchored_to: None,
                });
                views.surfaces.push(vertices);
                views.features.push(extractor.extract(frame.colour.as_deref()));
            }
        }
        Ok(views)
    }

    /// The true pose of one view in the frame of another.
    pub(crate) fn truly(&self, query: usize, target: usize) -> Pose {
        let [query, target] = [query, target].map(|k| Pose::from(&self.keyframes[k].world_from_camera));
        target.inverse() * query
    }
}

/// The true pose at a time and the motion per second in the camera's frame.
fn motion(truth: &Trajectory, stamp_nanos: i64) -> Option<(Pose, [f64; 6])> {
    const AROUND_NANOS: i64 = 20_000_000;
    let at = |stamp: i64| true_pose(truth, stamp);
    let pose = at(stamp_nanos)?;
    let velocity = match (at(stamp_nanos - AROUND_NANOS), at(stamp_nanos + AROUND_NANOS)) {
        (Some(before), Some(after)) => {
            log(&(before.inverse() * after)).scaled(0.5e9 / AROUND_NANOS as f64).to_vector().into()
        }
        _ => [0.0; 6],
    };
    Some((pose, velocity))
}

/// The true pose at a time, between its two neighbours.
fn true_pose(truth: &Trajectory, stamp_nanos: i64) -> Option<Pose> {
    let after = truth.stamps_nanos.partition_point(|stamp| *stamp < stamp_nanos);
    if truth.stamps_nanos.get(after) == Some(&stamp_nanos) {
        return Some(truth.poses[after]);
    }
    let before = after.checked_sub(1)?;
    let (t0, t1) = (truth.stamps_nanos[before], *truth.stamps_nanos.get(after)?);
    let share = (stamp_nanos - t0) as f64 / (t1 - t0) as f64;
    (t1 - t0 < 100_000_000).then(|| truth.poses[before].lerp_slerp(&truth.poses[after], share))
}
