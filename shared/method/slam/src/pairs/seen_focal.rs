//! The focal length that the features of a run's keyframes ask for.

use crate::map::context::Context;
use crate::map::view_limits::optical_axis;
use crate::pairs::lift::lift;
use crate::pairs::matching::{PairFinder, Reach, Seen};
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use tessera_features::{Feature, FocalRatio, Observation, ViewPair, focal_ratio};
use tessera_geometry::{Pose, Twist};
use tessera_surface::{SurfaceView, Vertex};

/// Angles between the optical axes of a pair, radians, and the factor by which one may be off: a smaller
/// one tells little, with a larger one little is shared.
const BEST_TURNS_RAD: [f64; 2] = [0.12, 0.22];
const MOST_OFF: f64 = 1.6;
/// Distance between the cameras of a pair at most, metres.
const MOST_APART_M: f64 = 0.6;
/// Pairs that are looked at.
const MOST_PAIRS: usize = 80;

/// A keyframe with its features.
#[derive(Clone, Debug)]
pub struct FocalView {
    features: Vec<Feature>,
    observations: Vec<Observation>,
}

impl FocalView {
    /// The features of a keyframe whose camera moved with `velocity` (per second, its own frame).
    pub fn new(context: &Context, features: Vec<Feature>, vertices: &[Vertex], velocity: &Twist) -> Self {
        let surface = SurfaceView { grid: context.grid, vertices };
        let observations = lift(context, &features, &surface, velocity);
        Self { features, observations }
    }

    fn seen(&self) -> Seen<'_> {
        Seen { features: &self.features, observations: &self.observations, session: None }
    }
}

/// Estimates the focal length of a camera over the stated one from keyframes' poses
/// (`world_from_camera`) and views, which `view` gives by place; `None` where they do not determine it.
///
/// # Errors
/// Those of `view`.
pub fn seen_focal_ratio<E>(
    context: &Context,
    poses: &[Pose],
    mut view: impl FnMut(usize) -> Result<FocalView, E>,
) -> Result<Option<FocalRatio>, E> {
    let mut views = BTreeMap::new();
    let mut finder = PairFinder::new(context);
    let mut seen = Vec::new();
    for (query, target) in pairs(poses) {
        for place in [query, target] {
            if let Entry::Vacant(unknown) = views.entry(place) {
                unknown.insert(view(place)?);
            }
        }
        let sides = [query, target].map(|place| FocalView::seen(&views[&place]));
        let target_from_query = poses[target].inv_mul(&poses[query]);
        let matches = finder.matches(context, sides, &target_from_query, Reach::Near);
        seen.push(ViewPair { target_from_query, matches });
    }
    let camera = &context.camera;
    Ok(focal_ratio(&seen, camera.focal_px()))
}

/// Pairs that turn against each other, at most [`MOST_PAIRS`], spread over all keyframes: each with the
/// earlier ones from which it is turned about as much as is best.
fn pairs(poses: &[Pose]) -> Vec<(usize, usize)> {
    let axes: Vec<_> = poses.iter().map(optical_axis).collect();
    // A long run has more than are needed.
    let queries = (0..poses.len()).step_by(poses.len().div_ceil(2 * MOST_PAIRS).max(1));
    let all = queries.flat_map(|query| {
        let near = (0..query).filter(|&other| {
            (poses[query].translation.vector - poses[other].translation.vector).norm() < MOST_APART_M
        });
        let turned: Vec<(f64, usize)> = near.map(|other| (axes[query].angle(&axes[other]), other)).collect();
        let mut best = BEST_TURNS_RAD.map(|turn_rad| {
            let off = |turn: f64| (turn / turn_rad).max(turn_rad / turn);
            let fit = turned.iter().filter(|(turn, _)| off(*turn) < MOST_OFF);
            fit.min_by(|a, b| off(a.0).total_cmp(&off(b.0))).map(|(_, other)| (query, *other))
        });
        if best[0] == best[1] {
            best[1] = None;
        }
        best.into_iter().flatten()
    });
    let all: Vec<(usize, usize)> = all.collect();
    let every = all.len().div_ceil(MOST_PAIRS).max(1);
    all.into_iter().step_by(every).collect()
}
