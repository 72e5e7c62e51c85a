//! Several files of one recording as one source, one behind the other.

use crate::{FrameBuffers, FrameInfo, Pairing, RecordingSource, Source, SourceError, TakenColour};
use tessera_geometry::{Camera, InertialRotation};

/// Interval to a file of one frame, nanoseconds.
const USUAL_INTERVAL_NANOS: i64 = 33_333_333;

/// Variance of a rotation of which nothing is known, radians^2.
const UNKNOWN_RAD2: f64 = 10.0;

/// Messages at the begin of a file that may be those at the end of the one before.
const MOST_AGAIN: usize = 2;

/// The frames of all files in the order of their times.
///
/// A depth image whose colour image stands in the neighbouring file goes without colour.
pub(crate) struct JoinedSource {
    parts: Vec<RecordingSource>,
    /// For each frame the part it is in, its index there, and its time, nanoseconds.
    frames: Vec<(u32, u64, i64)>,
    pairing: Pairing,
    warnings: Vec<String>,
}

impl JoinedSource {
    /// Begins with the first file.
    pub(crate) fn new(first: RecordingSource) -> Self {
        let mut joined =
            Self { parts: Vec::new(), frames: Vec::new(), pairing: Pairing::default(), warnings: Vec::new() };
        joined.add(first);
        joined
    }

    #[expect(clippy::indexing_slicing, reason = "it begins with one")]
    pub(crate) fn first(&self) -> &RecordingSource {
        &self.parts[0]
    }

    /// Adds the next file. One that begins before the last frame is a new stretch of time: the clock was
    /// set, or the same was recorded again.
    pub(crate) fn add(&mut self, part: RecordingSource) {
        let last = self.frames.last().map(|(_, _, stamp)| *stamp);
        let at = u32::try_from(self.parts.len()).unwrap_or(u32::MAX);
        let number = at.saturating_add(1);
        let stamps: Vec<i64> =
            (0..part.n_frames().unwrap_or(0)).map_while(|index| part.stamp_nanos(index)).collect();
        // The recorder may write the last message of a file again into the next.
        let n_again = last.map_or(0, |last| stamps.iter().take_while(|stamp| **stamp <= last).count());
        let is_again = last.is_some_and(|last| stamps.get(n_again.saturating_sub(1)) == Some(&last));
        let n_left_out =
            if is_again && n_again <= MOST_AGAIN && n_again < stamps.len() { n_again } else { 0 };
        let mut shift = 0;
        if n_left_out > 0 {
            self.warnings
                .push(format!("file {}: {n_left_out} messages repeat a time and are left out", number));
        } else if let (Some(last), Some(first)) = (last, stamps.first())
            && *first <= last
        {
            let interval = match stamps[..] {
                [first, second, ..] => second.saturating_sub(first),
                _ => USUAL_INTERVAL_NANOS,
            };
            shift = last.saturating_add(interval).saturating_sub(*first);
            self.warnings.push(format!(
                "file {} begins {:.3} s before the end of the one before it: its stamps are counted on as a new stretch of time",
                number,
                last.saturating_sub(*first) as f64 * 1e-9
            ));
        }
        let frames = (0..).zip(&stamps).skip(n_left_out);
        self.frames.extend(frames.map(|(index, stamp)| (at, index, stamp.saturating_add(shift))));
        let Pairing { n_depth, n_colour, n_pairs, largest_difference_nanos, taken_after_nanos } =
            part.pairing();
        let sum = |so_far: &mut usize, more: usize| *so_far = so_far.saturating_add(more);
        sum(&mut self.pairing.n_depth, n_depth);
        sum(&mut self.pairing.n_colour, n_colour);
        sum(&mut self.pairing.n_pairs, n_pairs);
        self.pairing.largest_difference_nanos =
            self.pairing.largest_difference_nanos.max(largest_difference_nanos);
        self.pairing.taken_after_nanos = self.pairing.taken_after_nanos.min(taken_after_nanos);
        self.warnings.extend(part.warnings().iter().cloned());
        self.parts.push(part);
    }

    /// Notes a file that cannot be used.
    pub(crate) fn leave_out(&mut self, error: &SourceError) {
        self.warnings.push(format!("{error}: this file is left out"));
    }

    /// Keeps at most so many frames.
    pub(crate) fn limit(&mut self, frames: Option<u64>) {
        let most = frames.and_then(|n| usize::try_from(n).ok()).unwrap_or(usize::MAX);
        self.frames.truncate(most);
    }

    /// A rotation since the first frame of its file: from one file to the next nothing is known of it.
    fn in_order(&self, index: u64, rotation: InertialRotation) -> InertialRotation {
        let part = usize::try_from(index).ok().and_then(|at| Some(self.frames.get(at)?.0));
        let before = self.parts.iter().take(part.unwrap_or(0) as usize);
        let unknown: f64 = before.map(|part| UNKNOWN_RAD2 + part.last_variance_rad2()).sum();
        InertialRotation { variance_rad2: rotation.variance_rad2 + unknown, ..rotation }
    }

    /// The part of a frame, and its index there.
    fn known_frame(&self, index: u64) -> Result<(&RecordingSource, u64), SourceError> {
        let last = (self.frames.len() as u64).saturating_sub(1);
        self.frame(index).ok_or(SourceError::NoFrame { frame: index, last })
    }

    fn frame(&self, index: u64) -> Option<(&RecordingSource, u64)> {
        let (part, at, _) = self.frames.get(usize::try_from(index).ok()?)?;
        Some((self.parts.get(*part as usize)?, *at))
    }
}

impl Source for JoinedSource {
    fn camera(&self) -> &Camera {
        self.first().camera()
    }

    fn n_frames(&self) -> Option<u64> {
        Some(self.frames.len() as u64)
    }

    fn stamp_nanos(&self, index: u64) -> Option<i64> {
        self.frames.get(usize::try_from(index).ok()?).map(|(_, _, stamp)| *stamp)
    }

    fn read(&self, index: u64, buffers: &mut FrameBuffers<'_>) -> Result<FrameInfo, SourceError> {
        let (part, at) = self.known_frame(index)?;
        let info = part.read(at, buffers)?;
        let stamp_nanos = self.stamp_nanos(index).unwrap_or(info.stamp_nanos);
        Ok(FrameInfo { stamp_nanos, rotation: info.rotation.map(|turn| self.in_order(index, turn)), ..info })
    }

    fn colour_as_taken(&self, index: u64) -> Result<Option<TakenColour>, SourceError> {
        let (part, at) = self.known_frame(index)?;
        part.colour_as_taken(at)
    }

    fn inspect(&self, index: u64) -> Result<(), SourceError> {
        let (part, at) = self.known_frame(index)?;
        part.inspect(at)
    }

    fn pairing(&self) -> Pairing {
        self.pairing
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn description(&self) -> Vec<(&'static str, String)> {
        let mut description = self.first().description();
        description.push(("files", self.parts.len().to_string()));
        description
    }
}
