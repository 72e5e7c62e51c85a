//! A source as it is asked for: without its first frames, and images that are too large reduced by whole steps.

use crate::{FrameBuffers, FrameInfo, Pairing, Source, SourceError, TakenColour};
use tessera_evaluation::Trajectory;
use tessera_frames::large::{reduce_colour, reduce_depth, reduced_camera, reduction};
use tessera_geometry::Camera;

/// All frames of a source from one on: what was its frame `n` is frame 0.
pub(crate) struct PartialSource {
    source: Box<dyn Source>,
    n_skipped: u64,
    /// Pixels of a row, and of a column, to one.
    step: u32,
    camera: Camera,
    warnings: Vec<String>,
}

impl PartialSource {
    /// Leaves the first frames out, and reduces what is too large.
    ///
    /// # Errors
    /// Where no frame is left.
    pub(crate) fn new(source: Box<dyn Source>, n_skipped: u64) -> Result<Self, SourceError> {
        if let Some(n_frames) = source.n_frames().filter(|n_frames| n_skipped > 0 && *n_frames <= n_skipped) {
            return Err(SourceError::NothingLeft { n_frames, n_skipped });
        }
        let full = source.camera();
        let (step, mut warnings) = (reduction(full), source.warnings().to_vec());
        let camera = if step > 1 { reduced_camera(full, step) } else { full.clone() };
        if step > 1 {
            warnings.push(format!(
                "images of {}x{} px are reduced to {}x{}, {step} pixels of a row to one",
                full.width, full.height, camera.width, camera.height
            ));
        }
        Ok(Self { source, n_skipped, step, camera, warnings })
    }

    fn inner(&self, index: u64) -> u64 {
        index.saturating_add(self.n_skipped)
    }

    fn read_reduced(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
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
}

impl Source for PartialSource {
    fn camera(&self) -> &Camera {
        &self.camera
    }

    fn n_frames(&self) -> Option<u64> {
        self.source.n_frames().map(|n| n.saturating_sub(self.n_skipped))
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.source.stamp_nanos(self.inner(index))
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        match self.step {
            1 => self.source.read(self.inner(index), buffers),
            _ => self.read_reduced(self.inner(index), buffers),
        }
    }

    fn colour_as_taken(&self, index: u64) -> Result<Option<TakenColour>, SourceError> {
        self.source.colour_as_taken(self.inner(index))
    }

    fn go_to(&self, index: u64, alive: &mut dyn FnMut()) {
        self.source.go_to(self.inner(index), alive);
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
        self.source.inspect(self.inner(index))
    }

    fn doubts(&self) -> &[String] {
        self.source.doubts()
    }

    fn description(&self) -> Vec<(&'static str, String)> {
        let mut description = self.source.description();
        let full = self.source.camera();
        if self.step > 1 {
            description.push(("reduced", format!("by {} from {}x{} px", self.step, full.width, full.height)));
        }
        description
    }
}

#[cfg(test)]
mod tests {
    use crate::{FrameBuffers, SceneName, SourceOptions, SourceSpec, open};

    #[test]
    fn frames_are_those_from_there_on() {
        let spec = SourceSpec::Scene(SceneName::Wall);
        let options = |skip, frames| SourceOptions { skip, frames, ..SourceOptions::default() };
        let (whole, rest) =
            (open(&spec, &options(0, None)).unwrap(), open(&spec, &options(7, Some(5))).unwrap());
        assert_eq!(rest.n_frames(), Some(5));
        assert_eq!((rest.stamp_nanos(0), rest.stamp_nanos(5)), (whole.stamp_nanos(7), None));
        let n = (whole.camera().width * whole.camera().height) as usize;
        let read = |source: &dyn crate::Source, index| {
            let (mut depth, mut colour) = (vec![0; n], vec![0; 3 * n]);
            source.read(index, &mut FrameBuffers { depth: &mut depth, colour: &mut colour }).unwrap();
            depth
        };
        assert!(read(&*rest, 2) == read(&*whole, 9));
        assert!(read(&*rest, 2) != read(&*whole, 2));
    }

    #[test]
    fn nothing_left_is_an_error() {
        let spec = SourceSpec::Scene(SceneName::Wall);
        let n = open(&spec, &SourceOptions::default()).unwrap().n_frames().unwrap();
        let options = SourceOptions { skip: n, ..SourceOptions::default() };
        let Err(error) = open(&spec, &options) else { panic!("nothing is left") };
        assert!(error.to_string().contains(&format!("{n} frames")), "{error}");
    }
}
