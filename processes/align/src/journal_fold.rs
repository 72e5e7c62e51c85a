//! Fold of the aligner's journal into the state that the next frame needs.

use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use tessera_slam::{AlignRecord, Context, FrameRecord, RequestRecord, Tracker, TrackerState};

/// How the source ended, once it has.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct End {
    /// Frames in the source.
    pub(crate) n_frames: u64,
    /// The final optimisation, if there is one.
    pub(crate) request: Option<RequestRecord>,
}

/// The fold over the journal. Records go through it one by one and are not kept: a restart late in
/// a run takes no more memory than one early in it.
pub(crate) struct JournalFold {
    pub(crate) tracker: Tracker,
    /// The last frame's record.
    pub(crate) last_frame: Option<FrameRecord>,
    pub(crate) end: Option<End>,
    /// Keyframes with an edge that closes a loop.
    pub(crate) n_loops: u64,
    /// Frames left out in live mode.
    pub(crate) n_left_out: u64,
    /// The request whose correction took effect last.
    pub(crate) last_applied: Option<u64>,
    /// The first record is an earlier run's map.
    pub(crate) begins_in_map: bool,
    n_records: u64,
}

/// The fold, as a checkpoint holds it.
#[derive(Serialize, Deserialize)]
pub(crate) struct FoldSnapshot<'a> {
    tracker: Cow<'a, TrackerState>,
    last_frame: Cow<'a, Option<FrameRecord>>,
    end: Option<End>,
    n_loops: u64,
    n_left_out: u64,
    last_applied: Option<u64>,
    begins_in_map: bool,
    n_records: u64,
}

impl JournalFold {
    pub(crate) fn new(tracker: Tracker) -> Self {
        Self {
            tracker,
            last_frame: None,
            end: None,
            n_loops: 0,
            n_left_out: 0,
            last_applied: None,
            begins_in_map: false,
            n_records: 0,
        }
    }

    pub(crate) fn snapshot(&self) -> FoldSnapshot<'_> {
        FoldSnapshot {
            tracker: Cow::Borrowed(self.tracker.state()),
            last_frame: Cow::Borrowed(&self.last_frame),
            end: self.end,
            n_loops: self.n_loops,
            n_left_out: self.n_left_out,
            last_applied: self.last_applied,
            begins_in_map: self.begins_in_map,
            n_records: self.n_records,
        }
    }

    /// The fold of all records before the snapshot.
    pub(crate) fn restore(context: Context, snapshot: FoldSnapshot<'_>) -> Self {
        Self {
            tracker: Tracker::restore(context, snapshot.tracker.into_owned()),
            last_frame: snapshot.last_frame.into_owned(),
            end: snapshot.end,
            n_loops: snapshot.n_loops,
            n_left_out: snapshot.n_left_out,
            last_applied: snapshot.last_applied,
            begins_in_map: snapshot.begins_in_map,
            n_records: snapshot.n_records,
        }
    }

    /// Applies the journal's next record.
    pub(crate) fn apply(&mut self, record: AlignRecord) {
        self.tracker.apply(&record);
        match record {
            AlignRecord::Frame(frame) => {
                let edges = frame.change.new_keyframe.iter().flat_map(|keyframe| &keyframe.edges);
                self.n_loops += u64::from(edges.filter(|edge| edge.is_loop).count() > 0);
                self.last_frame = Some(*frame);
            }
            AlignRecord::Correction(applied) => self.last_applied = Some(applied.correction.request),
            AlignRecord::End { n_frames, request } => self.end = Some(End { n_frames, request }),
            AlignRecord::Map(_) => self.begins_in_map |= self.n_records == 0,
            AlignRecord::Skipped(skipped) => {
                self.n_left_out = self.n_left_out.saturating_add(skipped.n());
            }
        }
        self.n_records += 1;
    }
}
