//! A source without its first frames: what was its frame `n` is frame 0.

use crate::{FrameBuffers, FrameInfo, Pairing, Source, SourceError, TakenColour};
use tessera_evaluation::Trajectory;
use tessera_geometry::Camera;

/// All frames of a source from one on.
pub(crate) struct SkippedSource {
    source: Box<dyn Source>,
    n_skipped: u64,
}

impl SkippedSource {
    /// Leaves the first frames out.
    ///
    /// # Errors
    /// Where no frame is left.
    pub(crate) fn new(source: Box<dyn Source>, n_skipped: u64) -> Result<Self, SourceError> {
        match source.n_frames() {
            Some(n_frames) if n_frames <= n_skipped => Err(SourceError::NothingLeft { n_frames, n_skipped }),
            _ => Ok(Self { source, n_skipped }),
        }
    }

    fn inner(&self, index: u64) -> u64 {
        index.saturating_add(self.n_skipped)
    }
}

impl Source for SkippedSource {
    fn camera(&self) -> &Camera {
        self.source.camera()
    }

    fn n_frames(&self) -> Option<u64> {
        self.source.n_frames().map(|n| n.saturating_sub(self.n_skipped))
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.source.stamp_nanos(self.inner(index))
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        self.source.read(self.inner(index), buffers)
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
        self.source.warnings()
    }

    fn inspect(&self, index: u64) -> Result<(), SourceError> {
        self.source.inspect(self.inner(index))
    }

    fn doubts(&self) -> &[String] {
        self.source.doubts()
    }

    fn description(&self) -> Vec<(&'static str, String)> {
        self.source.description()
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
