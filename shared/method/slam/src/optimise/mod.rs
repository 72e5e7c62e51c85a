//! Global optimisation of all keyframes (III-G), and what follows from it for the frames.

pub(crate) mod answer;
pub(crate) mod association;
pub(crate) mod culled;
pub(crate) mod from_appearance;
pub(crate) mod global;
mod gravity;
pub(crate) mod held;
pub(crate) mod interpolation;
mod judged_pair;
pub(crate) mod kept_matches;
pub(crate) mod keyframe_searches;
pub(crate) mod known_pairs;
pub(crate) mod matchables;
pub(crate) mod named_loops;
pub(crate) mod of_track;
pub(crate) mod optimiser;
pub(crate) mod pending;
pub(crate) mod refine;
pub(crate) mod refine_camera;
pub(crate) mod sample_cache;
