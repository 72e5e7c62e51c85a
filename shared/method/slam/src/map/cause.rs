//! Causes of a frame's outcome.

pub(super) mod words;

use serde::{Deserialize, Serialize};

/// Why a frame has its state, or what changes in the map with it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Cause {
    /// Relocalisation was asked for with this frame.
    RelocalisationAsked,
    /// The map begins.
    FirstFrame(Option<Levelling>),
    /// A submap begins with this frame.
    SubmapBegins(u32, Option<Levelling>),
    /// Too few points to be aligned.
    TooFewPoints {
        /// Usable points of the frame.
        n_points: u32,
        /// Least number of points.
        least: u32,
    },
    /// The normal equations could not be solved.
    Unsolved,
    /// Too few queries have a match.
    FewMatches {
        /// Share of the queries with a match.
        share: f64,
        /// Least share.
        least: f64,
    },
    /// The median residual is too large, standard deviations.
    LargeResidual {
        /// That of the worst reference.
        sigmas: f64,
        /// Largest allowed.
        most: f64,
    },
    /// Too little of the frame matches its best reference, or too much of it is in front of that.
    LowSupport {
        /// Its shares.
        fit: ReferenceFit,
        /// Least share matched.
        least_matched: f64,
        /// Largest share in front.
        most_in_front: f64,
    },
    /// The strict tests failed.
    NotStrict(ReferenceFit),
    /// No keyframe near the place that was found has its surface at hand.
    NoKeyframe,
    /// The evidence for the place that was found fell to this, nats.
    PlaceRefuted(f64),
    /// Lost for so many frames before.
    LostFor(u32),
    /// Not found in the map that the run starts in, for so many frames before.
    NotFoundFor(u32),
    /// None of so many candidate places fits.
    NoPlaceFits(u32),
    /// A place was found.
    Found(CandidatePlace, ReferenceFit),
    /// Evidence for the place that was found, nats.
    Confirmed {
        /// So far.
        sum_nats: f64,
        /// With which it is certain.
        bound_nats: f64,
    },
    /// Motions that the surfaces do not resist: along them the pose is the prediction.
    Degenerate(Vec<DegenerateMotion>),
    /// Two submaps are joined.
    Joined {
        /// The one that moves.
        moved: u32,
        /// The one that keeps its gauge.
        kept: u32,
        /// Evidence for it, nats.
        evidence_nats: f64,
        /// Overlap of the keyframes that were compared, a share.
        overlap: f64,
        /// Share of it in front of the other surface.
        in_front: f64,
    },
    /// A join that both submaps contradict.
    JoinRefused {
        /// The submap that would move.
        moved: u32,
        /// The one that would keep its gauge.
        kept: u32,
    },
    /// A submap begins with a keyframe: older ones contradict the map.
    Departure {
        /// The new submap.
        submap: u32,
        /// Its first keyframe.
        first: u32,
        /// The keyframe with which the evidence began.
        since: u32,
        /// Evidence against the map, nats.
        nats: f64,
    },
    /// All causes of a frame in a journal before version 17.
    Recorded {
        /// As they were printed.
        words: String,
        /// Whether a direction was degenerate.
        is_degenerate: bool,
        /// Whether relocalisation was asked for.
        is_relocalisation_asked: bool,
        /// Whether it had too few points.
        has_too_few_points: bool,
    },
}

impl Cause {
    pub(super) fn is_degenerate(&self) -> bool {
        matches!(self, Self::Degenerate(_) | Self::Recorded { is_degenerate: true, .. })
    }

    pub(super) fn is_relocalisation_asked(&self) -> bool {
        matches!(self, Self::RelocalisationAsked | Self::Recorded { is_relocalisation_asked: true, .. })
    }

    pub(super) fn has_too_few_points(&self) -> bool {
        matches!(self, Self::TooFewPoints { .. } | Self::Recorded { has_too_few_points: true, .. })
    }
}

/// How the first pose of a map was levelled.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Levelling {
    /// By gravity, with this standard deviation, radians.
    Gravity(f64),
    /// By the floor, with this standard deviation, radians.
    Floor(f64),
    /// Not: gravity was not measured, and no floor is seen.
    Failed,
}

/// Shares and residual of a frame against its best reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReferenceFit {
    /// Share of the frame in its view.
    pub in_view: f64,
    /// Share with a match of what falls within its surface.
    pub matched: f64,
    /// Share of the same which is in front of its surface.
    pub in_front: f64,
    /// Median residual, standard deviations.
    pub residual_sigmas: f64,
    /// Features that agree with the pose, where it was accepted by them.
    pub n_agreeing: Option<u32>,
}

/// A place that was tried for a frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum CandidatePlace {
    /// The pose at which the camera was last tracked.
    LastPose,
    /// The pose with which the run starts in its map.
    Start,
    /// The pose by features of a keyframe.
    Features {
        /// Their number.
        n: u32,
        /// The keyframe.
        keyframe: u32,
    },
    /// The pose of a keyframe with a similar descriptor.
    Similar {
        /// The keyframe.
        keyframe: u32,
        /// Similarity of both descriptors.
        similarity: f64,
    },
}

/// A motion of the new frame that the surfaces do not resist.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DegenerateMotion {
    /// Its kind.
    pub kind: MotionKind,
    /// Unit axis in the frame of the camera.
    pub axis: [f64; 3],
    /// Standard deviation that the matches claim for it, metres or radians.
    pub sigma: f64,
}

/// Kind of a motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum MotionKind {
    /// Along an axis.
    Translation,
    /// About an axis.
    Rotation,
}
