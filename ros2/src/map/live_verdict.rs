//! The verdict on a run that goes on: the facts of its journal so far, judged as the run itself judges
//! them once it has ended.

use std::collections::BTreeMap;
use tessera_geometry::Camera;
use tessera_outputs::Ended;
use tessera_outputs::facts::{Facts, FrameFacts};
use tessera_outputs::verdict::verdict;
use tessera_slam::{AlignRecord, State};

/// Facts that are counted as records come.
pub(crate) struct LiveVerdict {
    frames: FrameFacts,
    n_dropped: u64,
    /// Frames of each submap, and those of them that were tracked.
    submaps: BTreeMap<u32, (u64, u64)>,
    units_per_metre: f64,
    focal_px: f64,
}

impl LiveVerdict {
    /// No frame yet.
    pub(crate) fn new(camera: &Camera) -> Self {
        Self {
            frames: FrameFacts::default(),
            n_dropped: 0,
            submaps: BTreeMap::new(),
            units_per_metre: camera.units_per_metre,
            focal_px: camera.fx,
        }
    }

    /// Takes the next record in.
    pub(crate) fn add(&mut self, record: &AlignRecord) {
        match record {
            AlignRecord::Frame(frame) => {
                self.frames.add(frame);
                let (n, n_tracked) = self.submaps.entry(frame.submap).or_default();
                *n += 1;
                *n_tracked += u64::from(frame.state == State::Tracking);
            }
            AlignRecord::Skipped(skipped) => self.n_dropped = self.n_dropped.saturating_add(skipped.n()),
            AlignRecord::Map(_) | AlignRecord::Correction(_) | AlignRecord::End { .. } => {}
        }
    }

    /// Grade and reasons in a line, `None` before the first frame; `component` answers which submaps are joined. Loops, the lens and the
    /// ground truth are judged at the run's end alone.
    pub(crate) fn words(&self, component: impl Fn(u32) -> u32) -> Option<String> {
        let mut components: BTreeMap<u32, (u64, u64)> = BTreeMap::new();
        for (submap, (n, n_tracked)) in &self.submaps {
            let of = components.entry(component(*submap)).or_default();
            *of = (of.0 + n, of.1 + n_tracked);
        }
        // That with most tracked frames, the older of two.
        let main = components.iter().rev().max_by_key(|(_, (_, n_tracked))| *n_tracked).map(|(c, _)| *c);
        let frames = self.frames.facts().clone();
        if frames.n_processed == 0 {
            return None;
        }
        let facts = Facts {
            // Of its end nothing can be said yet.
            ended: Ended::Finished,
            n_read: frames.n_processed + self.n_dropped,
            n_dropped: self.n_dropped,
            apart: components.iter().filter(|(c, _)| Some(**c) != main).map(|(c, of)| (*c, of.0)).collect(),
            units_per_metre: self.units_per_metre,
            focal_px: self.focal_px,
            ..frames
        };
        let words = verdict(&facts).in_one_line();
        words.strip_prefix("verdict ").map(str::to_owned)
    }
}
