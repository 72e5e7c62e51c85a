//! The optimiser's answer to a request.

use crate::map::keyframe::KeyframePose;
use crate::map::rounded_pose::RoundedPose;
use crate::map::submaps::Submaps;
use serde::{Deserialize, Serialize};
use tessera_geometry::{Camera, PoseBits};

/// Verdict of a loop pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LoopVerdict {
    /// It takes part.
    Accepted,
    /// Too few queries have a match, in one of the directions.
    LittleOverlap,
    /// Points of one keyframe float in what the other saw to be empty.
    FreeSpaceViolated,
    /// Aligning the newer to the older and the older to the newer gives different answers.
    Inconsistent,
    /// The tests passed, but it contradicts the rest of the graph: the optimiser took its weight.
    Outvoted,
    /// Found by its looks, and contradicted by what it would bring together: a place that looks alike.
    Contradicted,
}

impl LoopVerdict {
    /// Whether the pair may fit elsewhere: it was refused by tests where the poses had it.
    pub(crate) fn is_of_where_it_was(self) -> bool {
        matches!(self, Self::LittleOverlap | Self::FreeSpaceViolated | Self::Inconsistent)
    }
}

/// A pair of keyframes that would close a loop, and why it does or does not take part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LoopRecord {
    /// The newer keyframe.
    pub newer: u32,
    /// The older keyframe.
    pub older: u32,
    /// Smaller share of queries with a match, of both directions.
    pub overlap: f64,
    /// Larger share of queries in view more than three standard deviations in front of what the
    /// other keyframe saw there, of both directions.
    pub in_front: f64,
    /// Root mean square disagreement between both directions, standard deviations of depth.
    pub inconsistency_sigmas: f64,
    /// Root mean square disagreement between the pair and the graph, standard deviations of depth.
    pub residual_sigmas: f64,
    /// Factor of the pair's cost at the end.
    pub weight: f64,
    /// Why.
    pub verdict: LoopVerdict,
}

/// Where the matches of a pair of keyframes were searched, in an eighth of a millimetre and of a milliradian: far below
/// their noise.
pub type MatchPose = RoundedPose<8192>;

/// A pair of keyframes whose matches were searched, or whose loop was refused, at a relative pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct MatchRecord {
    /// The newer keyframe, whose samples were the queries.
    pub newer: u32,
    /// The older keyframe.
    pub older: u32,
    /// `older_from_newer` of the search.
    pub at: MatchPose,
}

/// How the pairs of an answer differ from those of the answer before it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct PairChanges {
    /// Those that are new, or were searched at another relative pose.
    pub searched: Vec<MatchRecord>,
    /// Ids of the newer and the older keyframe of those that are no more.
    pub dropped: Vec<(u32, u32)>,
}

/// The answer to a request; by default one that corrects nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Correction {
    /// Which request.
    pub request: u64,
    /// Hash of the input it was computed from.
    pub input_hash: u64,
    /// The keyframes that were solved for, by id: those of the working map at the request, and in the final
    /// optimisation culled ones as well. Others move along with them ([`crate::PoseHistory`]).
    pub keyframes: Vec<KeyframePose>,
    /// Frames solved again against the optimised keyframes (final optimisation only).
    pub frames: Vec<(u64, PoseBits)>,
    /// Loop pairs with what their tests found and the weight that the optimiser left them: those of which
    /// earlier corrections had another verdict, and in the final one all.
    pub loops: Vec<LoopRecord>,
    /// The submaps of the request, apart where the optimiser refuted what had joined them.
    pub submaps: Submaps,
    /// Outer iterations done.
    pub outer_iterations: u32,
    /// Rounds of graduated non-convexity over all outer iterations; 0: every loop fitted at once.
    pub n_graduated_rounds: u32,
    /// The camera as a further unknown (final optimisation only, where the settings ask for it).
    pub refinement: Option<Refinement>,
}

/// Result of solving for the camera.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Refinement {
    /// Another camera fits the frames better.
    Refined(Box<RefinedCamera>),
    /// The frames determine none, and why: the run's camera stays.
    Kept(String),
}

/// A camera from the frames themselves, with the poses that go with it.
///
/// The map's own poses are those of [`Correction::keyframes`]: they fit the surfaces in the store,
/// which the run's camera made. These fit the surfaces as this camera would have made them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RefinedCamera {
    /// The camera.
    pub camera: Camera,
    /// How far the image moved from the run's camera to this one, root mean square pixels.
    pub moved_px: f64,
    /// Combinations of parameters that the motion does not determine: they keep the run's values.
    pub n_held: u32,
    /// Root mean square normal residual of keyframe pairs before and after, standard deviations
    /// of depth.
    pub residual_sigmas: [f64; 2],
    /// Every keyframe's pose, by id.
    pub keyframes: Vec<KeyframePose>,
    /// Frames solved again against those keyframes.
    pub frames: Vec<(u64, PoseBits)>,
}

/// A correction taking effect: the whole correction is copied into the aligner's own
/// journal, so that its state is a fold over one file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AppliedCorrection {
    /// First frame index aligned after it.
    pub before_frame: u64,
    /// The correction as applied.
    pub correction: Correction,
}
