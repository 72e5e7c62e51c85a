//! The focal length that the features of a map's keyframes fit.

use crate::{Method, SavedMap};
use std::convert::Infallible;
use tessera_features::FocalRatio;
use tessera_geometry::{Camera, Pose, Twist, Vector6};
use tessera_slam::{ColourModel, Context, FocalView, seen_focal_ratio};

/// The focal length over that of `camera`, with which the map was made; `None` where its keyframes' features
/// do not determine it.
pub fn focal_of_features(
    camera: &Camera,
    map: &SavedMap,
    method: &Method,
    colour: ColourModel,
) -> Option<FocalRatio> {
    let context = Context::new(camera, &method.surface, &method.registration, &method.mapping)
        .with_colour_model(colour);
    let poses: Vec<Pose> = map.keyframes.iter().map(|k| Pose::from(&k.world_from_camera)).collect();
    let view = |place: usize| {
        let velocity = Twist::from_vector(&Vector6::from(map.keyframes[place].velocity));
        let features = map.features.get(place).cloned().unwrap_or_default();
        Ok::<_, Infallible>(FocalView::new(&context, features, &map.surfaces[place], &velocity))
    };
    let Ok(found) = seen_focal_ratio(&context, &poses, view);
    found
}
