//! A world that stands upright: the first pose of a map, levelled by gravity or by the floor.

use crate::map::cause::Levelling;
use crate::settings::WorldUp;
use crate::tracking::input::TrackingInput;
use crate::tracking::prediction::Prediction;
use tessera_geometry::Pose;
use tessera_surface::floor_up;

/// The first pose of a map, and how it was levelled; as predicted with [`WorldUp::Camera`].
pub(crate) fn levelled(
    input: &TrackingInput<'_>,
    prediction: &Prediction,
) -> (Prediction, Option<Levelling>) {
    if input.context.mapping.world_up == WorldUp::Camera {
        return (*prediction, None);
    }
    let vertices = input.frame.surface.vertices;
    let known = input.frame.up.map(|up| (up, Levelling::Gravity(up.sigma_rad)));
    let floor = || floor_up(vertices).map(|up| (up, Levelling::Floor(up.sigma_rad)));
    let Some((up, levelling)) = known.or_else(floor) else {
        return (*prediction, Some(Levelling::Failed));
    };
    let predicted = &prediction.world_from_camera;
    let rotation = up.levelled(&predicted.rotation);
    let world_from_camera = Pose::from_parts(predicted.translation, rotation);
    (Prediction { world_from_camera, ..*prediction }, Some(levelling))
}
