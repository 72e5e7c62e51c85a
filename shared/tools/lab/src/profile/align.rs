//! Alignment alone.

use super::measure::{Meter, Options};
use super::recording::{Entry, Recorded, from_bytes};
use super::report::ProfileReport;
use tessera_features::Feature;
use tessera_geometry::{InertialRotation, UpDirection};
use tessera_journal::fingerprint;
use tessera_messages::Stage;
use tessera_outputs::ToolError;
use tessera_slam::{AlignRecord, AppliedCorrection, Context, FrameSurface, KeyframeSurfaces, Tracker};
use tessera_surface::{Grid, SurfaceView, Vertex, WorkloadLevel, packed};

/// Surfaces of keyframes in memory.
#[derive(Default)]
pub(super) struct ProfiledKeyframes(pub(super) Vec<(Vec<Vertex>, Vec<Feature>)>);

impl KeyframeSurfaces for ProfiledKeyframes {
    fn vertices(&self, keyframe: u32) -> &[Vertex] {
        self.0.get(keyframe as usize).map_or(&[], |keyframe| keyframe.0.as_slice())
    }

    fn features(&self, keyframe: u32) -> &[Feature] {
        self.0.get(keyframe as usize).map_or(&[], |keyframe| keyframe.1.as_slice())
    }
}

/// One piece of input.
enum Input {
    Surface(RecordedSurface),
    Correction(AppliedCorrection),
}

struct RecordedSurface {
    index: u64,
    stamp_nanos: i64,
    rotation: Option<InertialRotation>,
    up: Option<UpDirection>,
    vertices: Vec<Vertex>,
    features: Vec<Feature>,
    expected: u32,
}

impl RecordedSurface {
    fn view(&self, grid: Grid) -> FrameSurface<'_> {
        FrameSurface {
            index: self.index,
            stamp_nanos: self.stamp_nanos,
            rotation: self.rotation,
            up: self.up,
            surface: SurfaceView { grid, vertices: &self.vertices },
            workload: WorkloadLevel::Full,
            relocalise_from: 0,
            features: &self.features,
        }
    }
}

/// What the aligner and the optimiser share, for a recording.
pub(super) fn context(recorded: &Recorded, meter: &Meter) -> Context {
    let method = recorded.method();
    let mut context = Context::new(&recorded.camera, &method.surface, &method.registration, &method.mapping);
    context.stamp_sigma_s = recorded.stamp_sigma_s;
    context.steps = meter.steps();
    context
}

/// Aligns each recorded surface.
pub(super) fn profile(recorded: &Recorded, options: &Options) -> Result<ProfileReport, ToolError> {
    let mut meter = Meter::new(Stage::Align, options);
    let grid = context(recorded, &meter).grid;
    let mut inputs = Vec::new();
    for entry in &recorded.entries {
        match entry {
            Entry::Surface { index, stamp_nanos, rotation, up, vertices, expected } => {
                let (vertices, features) = from_bytes(vertices, grid.len())?;
                let (index, stamp_nanos, expected) = (*index, *stamp_nanos, *expected);
                let (rotation, up) = (*rotation, *up);
                let surface =
                    RecordedSurface { index, stamp_nanos, rotation, up, vertices, features, expected };
                inputs.push(Input::Surface(surface));
            }
            Entry::Correction(applied) => inputs.push(Input::Correction((**applied).clone())),
            _ => {}
        }
    }
    for _ in 0..options.repeat {
        pass(&inputs, context(recorded, &meter), &mut meter)?;
    }
    Ok(meter.report(options))
}

/// One pass from an empty map to the last frame.
fn pass(inputs: &[Input], context: Context, meter: &mut Meter) -> Result<(), ToolError> {
    let grid = context.grid;
    let mut tracker = Tracker::new(context);
    let mut keyframes = ProfiledKeyframes::default();
    let mut previous: Option<&RecordedSurface> = None;
    for input in inputs {
        let surface = match input {
            Input::Surface(surface) => surface,
            Input::Correction(applied) => {
                let before = applied.before_frame;
                let record = tracker.correction_record(applied.correction.clone(), before);
                let Some(record) = record else {
                    return Err(ToolError::Stage(format!(
                        "the correction before frame {before} answers no request"
                    )));
                };
                tracker.apply(&record);
                continue;
            }
        };
        let recent: Vec<FrameSurface<'_>> = previous.iter().map(|of| of.view(grid)).collect();
        let current = surface.view(grid);
        let record = meter.time(|| tracker.align(&current, &recent, &keyframes));
        if let Some(keyframe) = &record.change.new_keyframe {
            let is_own = keyframe.frame_index == surface.index;
            let of = if is_own { Some(surface) } else { previous };
            keyframes.0.extend(of.map(|of| (packed::rounded(&of.vertices), of.features.clone())));
        }
        let record = AlignRecord::Frame(Box::new(record));
        meter.check(fingerprint(&record)?, surface.expected, &format!("frame {}", surface.index))?;
        tracker.apply(&record);
        previous = Some(surface);
    }
    Ok(())
}
