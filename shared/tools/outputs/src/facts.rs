//! What a verdict on a run is made of, as plain data.

use crate::replay::Replay;
use crate::statistics::{Ended, RunStatistics};
use crate::truth::{Truth, lengths};
use std::collections::BTreeMap;
use std::fmt;
use tessera_evaluation::{LateralScale, Trajectory};
use tessera_features::FocalRatio;
use tessera_slam::{ColourModel, FrameRecord, State};

/// Stated standard deviation of a position above which it is not to be relied on, metres.
pub(crate) const UNCERTAIN_M: f64 = 0.1;

/// Positions of the variances of x, y, z in the upper triangle of a 6x6 matrix, row by row.
const POSITION: [usize; 3] = [0, 6, 11];
/// Frames one after the other, both ends included.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Span {
    /// Index of the first frame.
    pub first: u64,
    /// Index of the last frame.
    pub last: u64,
    /// Time of the first since the run's first frame, seconds.
    pub from_s: f64,
    /// Time of the last, seconds.
    pub to_s: f64,
}

impl Span {
    /// From the first frame to the last, seconds.
    pub fn duration_s(&self) -> f64 {
        self.to_s - self.from_s
    }
}

impl fmt::Display for Span {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.first == self.last {
            true => write!(f, "frame {} ({:.1} s)", self.first, self.from_s),
            false => {
                write!(f, "frames {} to {} ({:.1} to {:.1} s)", self.first, self.last, self.from_s, self.to_s)
            }
        }
    }
}

/// The facts of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Facts {
    /// How it ended.
    pub ended: Ended,
    /// Frames that the source gave.
    pub n_read: u64,
    /// Frames with a record.
    pub n_processed: u64,
    /// Frames left out in a live run.
    pub n_dropped: u64,
    /// Frames that ended their stage again and again.
    pub n_missing: u64,
    /// Frames whose pose is a prediction.
    pub n_untracked: u64,
    /// Where they are.
    pub untracked: Vec<Span>,
    /// Those among them whose depth images hold too little to be aligned.
    pub n_without_depth: u64,
    /// Whether the last frame is one of them.
    pub ends_untracked: bool,
    /// Tracked frames whose surfaces leave a direction of motion open, which the prediction then holds.
    pub n_degenerate: u64,
    /// Where they are.
    pub degenerate: Vec<Span>,
    /// Tracked frames with a stated deviation of position above the limit.
    pub n_uncertain: u64,
    /// The first of them.
    pub first_uncertain: Option<u64>,
    /// Largest stated deviation of a position, metres.
    pub worst_deviation_m: f64,
    /// Frames with a missing or broken image, and what is wrong.
    pub broken: BTreeMap<u64, String>,
    /// Loops that the optimisation kept.
    pub n_loops_closed: u64,
    /// Loops that passed verification and that the optimisation rejected.
    pub n_loops_rejected: u64,
    /// Submaps that began.
    pub n_submaps: u64,
    /// Processed frames of each submap that is apart from that of `trajectory.txt`.
    pub apart: BTreeMap<u32, u64>,
    /// Started in a map and never found there.
    pub is_nowhere: bool,
    /// Lengths against the ground truth, where there is one.
    pub truth: Option<Truth>,
    /// Raw depth of a metre.
    pub units_per_metre: f64,
    /// Focal length of the camera along x, pixels.
    pub focal_px: f64,
    /// What features say of it.
    pub seen_focal: Option<FocalRatio>,
    /// Motions across the view against the true ones, as that camera saw them, where they tell something.
    pub lateral: Option<LateralScale>,
    /// Log odds at the end of the run that colour is of the time and place of depth, where it is not believed.
    pub unbelieved_colour: Option<f64>,
    /// Focal length of the camera and of the refined one, pixels.
    pub refined_focal_px: Option<[f64; 2]>,
    /// What looked wrong with the source before the run.
    pub source_doubts: Vec<String>,
    /// What was assumed of it, left out or mended.
    pub source_warnings: Vec<String>,
}

/// What lies in the run directory beside the journal.
#[derive(Clone, Debug, Default)]
pub struct Beside {
    /// Frames with a missing or broken image.
    pub broken: BTreeMap<u64, String>,
    /// What looked wrong with the source before the run.
    pub source_doubts: Vec<String>,
    /// What was assumed of it, left out or mended.
    pub source_warnings: Vec<String>,
    /// Raw depth of a metre.
    pub units_per_metre: f64,
    /// Focal length along x, pixels.
    pub focal_px: f64,
    /// What features say of it.
    pub seen_focal: Option<FocalRatio>,
    /// What the ground truth says of it.
    pub lateral: Option<LateralScale>,
    /// What the camera file states of colour.
    pub stated_colour: ColourModel,
    /// Corrections that the base of a fleet computed, where the run asked one.
    pub n_from_base: Option<u64>,
}

impl Facts {
    /// Collects the facts.
    pub fn new(
        replay: &Replay,
        statistics: &RunStatistics,
        truth: Option<&Trajectory>,
        beside: &Beside,
    ) -> Self {
        let (processed, dropped) = (replay.frames.len() as u64, replay.n_skipped());
        // Until the source has ended, what was sent and not yet processed is not lost but undone.
        let n_read = replay.n_source_frames.unwrap_or(0).max(processed.saturating_add(dropped));
        let mut frames = FrameFacts::default();
        replay.frames.iter().for_each(|frame| frames.add(frame));
        let colour = replay.colour(beside.stated_colour);
        let refined = replay.refined().map(|refined| [beside.focal_px, refined.camera.fx]);
        Self {
            ended: statistics.ended,
            n_read,
            n_dropped: dropped,
            n_missing: n_read.saturating_sub(processed).saturating_sub(dropped),
            broken: beside.broken.clone(),
            n_loops_closed: replay.n_loops_closed(),
            n_loops_rejected: replay.n_loops_rejected(),
            n_submaps: u64::from(replay.submaps().n()),
            apart: replay.apart(),
            is_nowhere: replay.n_map_keyframes > 0 && replay.first_tracked.is_none(),
            truth: truth.and_then(|truth| lengths(replay, truth)),
            units_per_metre: beside.units_per_metre,
            focal_px: beside.focal_px,
            seen_focal: beside.seen_focal,
            lateral: beside.lateral,
            unbelieved_colour: (!colour.is_trusted()).then_some(colour.own_nats),
            refined_focal_px: refined,
            source_doubts: beside.source_doubts.clone(),
            source_warnings: beside.source_warnings.clone(),
            ..frames.facts
        }
    }
}

/// What processed frames say, counted as they come: also of a run that goes on.
#[derive(Clone, Debug, Default)]
pub struct FrameFacts {
    facts: Facts,
    first_nanos: Option<i64>,
    is_degenerate: bool,
}

impl FrameFacts {
    /// Takes the next frame in.
    #[expect(
        clippy::arithmetic_side_effects,
        reason = "counts of 64 bits, of the frames in memory or followed"
    )]
    pub fn add(&mut self, frame: &FrameRecord) {
        let first_nanos = *self.first_nanos.get_or_insert(frame.stamp_nanos);
        let at = (frame.index, frame.stamp_nanos.saturating_sub(first_nanos) as f64 * 1e-9);
        let facts = &mut self.facts;
        let (is_untracked, is_degenerate) = (frame.state != State::Tracking, frame.is_degenerate());
        facts.n_processed += 1;
        facts.n_untracked += u64::from(is_untracked);
        facts.n_without_depth += u64::from(is_untracked && frame.has_too_few_points());
        facts.n_degenerate += u64::from(is_degenerate);
        if is_untracked {
            extend(&mut facts.untracked, facts.ends_untracked, at);
        }
        if is_degenerate {
            extend(&mut facts.degenerate, self.is_degenerate, at);
        }
        (facts.ends_untracked, self.is_degenerate) = (is_untracked, is_degenerate);
        let Some(deviation) = deviation_m(frame).filter(|_| !is_untracked) else { return };
        facts.worst_deviation_m = facts.worst_deviation_m.max(deviation);
        if deviation > UNCERTAIN_M {
            facts.n_uncertain += 1;
            facts.first_uncertain.get_or_insert(frame.index);
        }
    }

    /// Those of all frames so far; what else a run has is as by default.
    pub fn facts(&self) -> &Facts {
        &self.facts
    }
}

/// Lengthens the last span, where it goes on, to the frame of that index and time, or begins one there.
fn extend(spans: &mut Vec<Span>, goes_on: bool, (index, at_s): (u64, f64)) {
    match spans.last_mut().filter(|_| goes_on) {
        Some(span) => (span.last, span.to_s) = (index, at_s),
        None => spans.push(Span { first: index, last: index, from_s: at_s, to_s: at_s }),
    }
}

/// Stated standard deviation of a position along the worst of all directions, from above: the root
/// of the sum of the three variances, metres.
pub fn deviation_m(frame: &FrameRecord) -> Option<f64> {
    let variances = POSITION.map(|at| frame.pose.covariance.get(at).copied());
    let [Some(x), Some(y), Some(z)] = variances else { return None };
    Some((x + y + z).max(0.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_run;
    use tessera_slam::Cause;

    #[test]
    fn the_facts_are_those_of_the_journal() {
        let replay = test_run::replay();
        let statistics = RunStatistics { ended: Ended::Finished, ..RunStatistics::default() };
        let facts = Facts::new(&replay, &statistics, None, &Beside::default());
        assert_eq!((facts.n_read, facts.n_processed, facts.n_dropped, facts.n_missing), (7, 6, 1, 0));
        assert_eq!((facts.n_untracked, facts.untracked.len(), facts.ends_untracked), (1, 1, false));
        assert_eq!(facts.untracked[0].to_string(), "frame 4 (0.1 s)");
        assert_eq!((facts.n_loops_closed, facts.n_loops_rejected), (1, 1));
        // The one covariance is that of a frame that was not tracked.
        assert_eq!((facts.n_uncertain, facts.worst_deviation_m), (0, 0.0));
    }

    #[test]
    fn degenerate_frames_are_those_that_say_so_and_were_tracked() {
        let mut replay = test_run::replay();
        let n = replay.frames.len();
        for frame in &mut replay.frames[n - 3..] {
            frame.state = State::Tracking;
            frame.causes = vec![Cause::Degenerate(Vec::new())];
        }
        replay.frames[n - 1].state = State::Lost;
        let facts = Facts::new(&replay, &RunStatistics::default(), None, &Beside::default());
        let (first, last) = (replay.frames[n - 3].index, replay.frames[n - 2].index);
        assert_eq!(facts.n_degenerate, 2);
        assert_eq!((facts.degenerate[0].first, facts.degenerate[0].last), (first, last));
    }
}
