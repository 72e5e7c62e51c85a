//! Records of the journals of aligner and optimiser: their whole durable state.
//!
//! The state of both is a fold over these records and nothing else, so a process
//! that restarted and one that did not hold the same bits.

pub use crate::map::correction::{
    AppliedCorrection, Correction, LoopRecord, LoopVerdict, MatchPose, MatchRecord, PairChanges,
    RefinedCamera, Refinement,
};
pub use crate::map::frame::{EvidenceRecord, FrameRecord, MapChange, PoseRecord, State};
pub use crate::map::keyframe::{
    EdgeRecord, KeyframePose, KeyframeRecord, KeyframeState, RetiredRecord, StoreSlot,
};
use crate::map::single;
use crate::map::submaps::{MOST_LISTED, Submaps};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use tessera_geometry::{Pose, PoseBits};
use tessera_graph::{PairBlock, Quadratic};

/// All matches between a frame and one keyframe: their cost to second order (method 5.4).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BlockRecord {
    /// The keyframe that was searched.
    pub keyframe: u32,
    /// The transform at which the matches were found, in numbers of single precision.
    #[serde(with = "single::pose")]
    pub keyframe_from_camera: PoseBits,
    /// `H`, `g` and `c`, 28 numbers.
    pub cost: Vec<f32>,
    /// Matches.
    pub n_matches: u32,
}

impl BlockRecord {
    /// The cost as a term of a graph; `None` where it is not one.
    pub fn pair_block(&self) -> Option<PairBlock> {
        let cost = Quadratic::from_numbers(&self.cost)?;
        Some(PairBlock::quadratic(&Pose::from(&self.keyframe_from_camera), cost, self.n_matches))
    }
}

/// A keyframe of another submap, seen from the camera's own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SightingRecord {
    /// Keyframe of the other submap.
    pub seen: u32,
    /// Keyframe of the camera's submap.
    pub own: u32,
    /// Where the other one sees it.
    pub seen_from_own: PoseBits,
    /// Evidence for it so far, thousandths of a nat.
    pub evidence_millinats: u32,
}

impl SightingRecord {
    /// Sum of the log-likelihood ratios of the views that showed it, nats.
    pub fn evidence_nats(&self) -> f64 {
        f64::from(self.evidence_millinats) * 1e-3
    }
}

/// Evidence that the camera is not where the map has it, a cumulative sum (method 12.8).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ContradictionRecord {
    /// The newest keyframe when it began.
    pub first: u32,
    /// Evidence of "elsewhere" by the keyframes of long ago that were looked at before `seen`, nats.
    pub before_nats: f64,
    /// The keyframe of long ago that was looked at last.
    pub seen: u32,
    /// Looks at it in a row: what it shows again is known already.
    pub n_looks: u32,
    /// Sum of their evidence, nats.
    pub looks_nats: f64,
}

impl ContradictionRecord {
    /// With a look at a keyframe of long ago that tells `nats` against the map; `None` where nothing does any more.
    pub(crate) fn with(known: Option<&Self>, newest: u32, (seen, nats): (u32, f64)) -> Option<Self> {
        let next = match known {
            Some(known) if known.seen == seen => Self {
                n_looks: known.n_looks.saturating_add(1),
                looks_nats: known.looks_nats + nats,
                ..*known
            },
            known => Self {
                first: known.map_or(newest, |known| known.first),
                before_nats: known.map_or(0.0, Self::sum_nats),
                seen,
                n_looks: 1,
                looks_nats: nats,
            },
        };
        (next.sum_nats() > 0.0).then_some(next)
    }

    /// Log-likelihood ratio of "elsewhere", nats: each keyframe of long ago counts by the mean of its looks.
    pub fn sum_nats(&self) -> f64 {
        self.before_nats + self.looks_nats / f64::from(self.n_looks.max(1))
    }
}

/// The camera had left its submap before that was noticed: its latest keyframes are of new ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SplitRecord {
    /// The first keyframe of a submap of its own for what was made between the last of the old map and the first of
    /// the new one, of neither for sure; none where there is none.
    pub carried: Option<u32>,
    /// The first keyframe of the submap in which the camera is now.
    pub first: u32,
}

impl SplitRecord {
    /// Only what came since this keyframe is of a new submap.
    pub(crate) fn since(first: u32) -> Self {
        Self { carried: None, first }
    }

    /// The first keyframe of each new submap, in their order.
    pub fn firsts(&self) -> impl Iterator<Item = u32> + use<> {
        self.carried.into_iter().chain([self.first])
    }
}

/// Two components that become one: all poses of one of them move into the gauge of the other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct JoinRecord {
    /// The component whose poses stay.
    pub kept: u32,
    /// The component whose poses move.
    pub moved: u32,
    /// The motion.
    pub kept_from_moved: PoseBits,
}

/// A request to optimise all keyframes made so far.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RequestRecord {
    /// 0, 1, 2, …
    pub request: u64,
    /// Keyframes `0..n_keyframes` take part.
    pub n_keyframes: u32,
    /// The correction takes effect before this frame index is aligned.
    pub effective_before: u64,
    /// The optimisation at the end of the run.
    pub is_final: bool,
}

/// The map of an earlier run, in which a run starts: the first record of its journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MapRecord {
    /// All keyframes of the map as finally corrected, by id; slots are those of this run's store.
    pub keyframes: Vec<KeyframeState>,
    /// Which of its submaps are joined.
    pub submaps: Submaps,
    /// Where the camera stands in the map at the first frame, where that is known.
    pub start: Option<PoseBits>,
}

/// Consecutive frames that were left out in live mode, for one reason.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkippedFrames {
    /// Their indices.
    pub frames: Range<u64>,
    /// Why.
    pub reason: String,
}

impl SkippedFrames {
    /// Number of frames; 0 of a range that ends before it begins.
    pub fn n(&self) -> u64 {
        self.frames.end.saturating_sub(self.frames.start)
    }

    /// The frames for a list of them, which a forged record cannot make endless.
    pub fn listed(&self) -> Range<u64> {
        let Range { start, end } = self.frames;
        start..end.min(start.saturating_add(MOST_LISTED.into()))
    }
}

/// One record of the aligner's journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum AlignRecord {
    /// A frame was aligned (or lost), with all that happened at this step.
    Frame(Box<FrameRecord>),
    /// Frames were left out in live mode.
    Skipped(SkippedFrames),
    /// A correction took effect.
    Correction(Box<AppliedCorrection>),
    /// The source is exhausted after this many frames, and the final request.
    End {
        /// Frames in the source.
        n_frames: u64,
        /// The final optimisation, unless there is nothing to optimise.
        request: Option<RequestRecord>,
    },
    /// The run starts in this map. First of all records, or absent.
    Map(Box<MapRecord>),
}

impl AlignRecord {
    /// The frame behind those of this record; `None` of a record without frames.
    pub fn next_index(&self) -> Option<u64> {
        match self {
            Self::Frame(frame) => Some(frame.index.saturating_add(1)),
            Self::Skipped(skipped) => Some(skipped.frames.end),
            Self::Correction(_) | Self::End { .. } | Self::Map(_) => None,
        }
    }
}

/// One record of the optimiser's journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum OptimiseRecord {
    /// A request was answered.
    Correction(Box<Correction>),
    /// A request was answered by the base of a fleet, of which no pairs are known.
    FromBase(Box<Correction>),
    /// A request was answered, and the next answer goes on from the pairs of this one.
    Incremental(Box<Correction>, PairChanges),
    /// The same by the base of a fleet, from the keyframes of several runs.
    IncrementalFromBase(Box<Correction>, PairChanges),
}

impl OptimiseRecord {
    /// The answer.
    pub fn correction(&self) -> &Correction {
        match self {
            Self::Correction(correction)
            | Self::FromBase(correction)
            | Self::Incremental(correction, _)
            | Self::IncrementalFromBase(correction, _) => correction,
        }
    }

    /// How its pairs differ from those before it; `None` where that is not known.
    pub fn pair_changes(&self) -> Option<&PairChanges> {
        match self {
            Self::Correction(_) | Self::FromBase(_) => None,
            Self::Incremental(_, changes) | Self::IncrementalFromBase(_, changes) => Some(changes),
        }
    }

    /// Whether the base of a fleet answered.
    pub fn is_from_base(&self) -> bool {
        matches!(self, Self::FromBase(_) | Self::IncrementalFromBase(..))
    }

    /// The answer alone, without its origin.
    pub fn into_correction(self) -> Correction {
        match self {
            Self::Correction(correction)
            | Self::FromBase(correction)
            | Self::Incremental(correction, _)
            | Self::IncrementalFromBase(correction, _) => *correction,
        }
    }
}
