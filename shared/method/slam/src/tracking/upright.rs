//! A world that stands upright: the first pose of a map, levelled by gravity or by the floor.

use crate::settings::WorldUp;
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Prediction;
use tessera_geometry::Pose;
use tessera_surface::floor_up;

/// The first pose of a map, and how it was levelled in words; as predicted with [`WorldUp::Camera`].
pub(crate) fn levelled(input: &TrackingInput<'_>, prediction: &Prediction) -> (Prediction, Option<String>) {
    if input.context.mapping.world_up == WorldUp::Camera {
        return (*prediction, None);
    }
    let vertices = input.frame.surface.vertices;
    let known = input.frame.up.map(|up| (up, "gravity"));
    let Some((up, by)) = known.or_else(|| Some((floor_up(vertices)?, "the floor"))) else {
        let words = "not levelled: gravity was not measured, and no floor is seen";
        return (*prediction, Some(words.to_owned()));
    };
    let predicted = &prediction.world_from_camera;
    let rotation = up.levelled(&predicted.rotation);
    let world_from_camera = Pose::from_parts(predicted.translation, rotation);
    let words = format!("levelled by {by}, within {:.1} deg", up.sigma_rad.to_degrees());
    (Prediction { world_from_camera, ..*prediction }, Some(words))
}
