//! A source whose images are larger than those that are processed: blocks of pixels become one.

use crate::{FrameBuffers, FrameInfo, Pairing, Source, SourceError, TakenColour};
use tessera_evaluation::Trajectory;
use tessera_frames::large::{reduce_colour, reduce_depth, reduced_camera};
use tessera_geometry::Camera;

/// All frames of a source, smaller by a whole step.
pub(crate) struct ReducedSource {
    source: Box<dyn Source>,
    step: u32,
    camera: Camera,
    warnings: Vec<String>,
}

impl ReducedSource {
    /// Blocks of `step` times `step` pixels become one.
    pub(crate) fn new(source: Box<dyn Source>, step: u32) -> Self {
        let full = source.camera();
        let camera = reduced_camera(full, step);
        let mut warnings = source.warnings().to_vec();
        warnings.push(format!(
            "images of {}x{} px are reduced to {}x{}, {step} pixels of a row to one",
            full.width, full.height, camera.width, camera.height
        ));
        Self { source, step, camera, warnings }
    }
}

impl Source for ReducedSource {
    fn camera(&self) -> &Camera {
        &self.camera
    }

    fn n_frames(&self) -> Option<u64> {
        self.source.n_frames()
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.source.stamp_nanos(index)
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        buffers.check(&self.camera)?;
        let full = self.source.camera();
        let n = (full.width as usize).saturating_mul(full.height as usize);
        let (mut depth, mut colour) = (vec![0; n], vec![0; n.saturating_mul(3)]);
        let mut whole = FrameBuffers { depth: &mut depth, colour: &mut colour };
        let info = self.source.read(index, &mut whole);
        let (width, to_width) = (full.width, self.camera.width);
        if matches!(info, Ok(_) | Err(SourceError::Colour(_))) {
            reduce_depth(&depth, width, self.step, buffers.depth, to_width);
        }
        let info = info?;
        reduce_colour(&colour, width, self.step, buffers.colour, to_width);
        Ok(info)
    }

    fn colour_as_taken(&self, index: u64) -> Result<Option<TakenColour>, SourceError> {
        self.source.colour_as_taken(index)
    }

    fn go_to(&self, index: u64, alive: &mut dyn FnMut()) {
        self.source.go_to(index, alive);
    }

    fn ground_truth(&self) -> Option<&Trajectory> {
        self.source.ground_truth()
    }

    fn pairing(&self) -> Pairing {
        self.source.pairing()
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn inspect(&self, index: u64) -> Result<(), SourceError> {
        self.source.inspect(index)
    }

    fn doubts(&self) -> &[String] {
        self.source.doubts()
    }

    fn description(&self) -> Vec<(&'static str, String)> {
        let mut description = self.source.description();
        let full = self.source.camera();
        description.push(("reduced", format!("by {} from {}x{} px", self.step, full.width, full.height)));
        description
    }
}
