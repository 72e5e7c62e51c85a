//! A person who walks about in front of the camera: what a static world has to survive.

use crate::material::{Material, TexturePattern};
use crate::path::Walk;
use crate::solid::{Carrier, Shape, Solid};

/// A person's solids, about the place where the feet are.
pub(super) fn solids(seed: u64, carrier: Carrier) -> Vec<Solid> {
    let trousers = Material::plain([0.2, 0.25, 0.4]);
    let shirt = Material::patterned([0.75, 0.3, 0.25], TexturePattern::Stripes(0.06), 0.4);
    let skin = Material::plain([0.85, 0.65, 0.52]);
    let parts = [
        (Shape::Cylinder, [-0.1, 0.0, 0.42], [0.17, 0.17, 0.84], trousers),
        (Shape::Cylinder, [0.1, 0.0, 0.42], [0.17, 0.17, 0.84], trousers),
        (Shape::Box, [0.0, 0.0, 1.13], [0.42, 0.24, 0.58], shirt),
        (Shape::Cylinder, [-0.28, 0.0, 1.1], [0.1, 0.1, 0.6], shirt),
        (Shape::Cylinder, [0.28, 0.0, 1.1], [0.1, 0.1, 0.6], shirt),
        (Shape::Cylinder, [0.0, 0.0, 1.45], [0.12, 0.12, 0.1], skin),
        (Shape::Sphere, [0.0, 0.0, 1.6], [0.24, 0.24, 0.24], skin),
    ];
    let solid =
        |(at, (shape, centre, size, material)): (usize, (Shape, [f32; 3], [f32; 3], Material))| Solid {
            shape,
            centre,
            half: size.map(|side| 0.5 * side),
            turn: [1.0, 0.0],
            material: material.keyed(seed.wrapping_add(0x9e25 + at as u64)),
            carrier,
        };
    parts.into_iter().enumerate().map(solid).collect()
}

/// Where the companion's feet are at a time: about 1.4 m ahead, crossing the view from side to side.
pub(super) fn place(walk: &Walk, time_s: f64) -> [f32; 3] {
    let way_s = walk.way_s(time_s);
    let gaze = walk.gaze(way_s);
    let angle = gaze.yaw + 0.75 * libm::sin(0.8 * time_s);
    let away_m = 1.4 + 0.25 * libm::sin(0.47 * time_s);
    [
        (gaze.position.x + away_m * libm::cos(angle)) as f32,
        (gaze.position.y + away_m * libm::sin(angle)) as f32,
        (walk.floor_m(way_s) + 0.02 * libm::sin(9.0 * time_s).abs()) as f32,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneName;
    use crate::building::Proportions;

    #[test]
    fn a_companion_keeps_ahead_of_a_camera_of_any_speed() {
        for speed in [0.5, 1.0, 3.0] {
            let walk = Walk::new(SceneName::House, 1, Proportions::drawn(0)).at_speed(speed);
            for time_s in [0.0, 5.0, 12.5] {
                let feet = place(&walk, time_s).map(f64::from);
                let camera = walk.gaze(walk.way_s(time_s)).position;
                let apart_m = libm::hypot(feet[0] - camera.x, feet[1] - camera.y);
                assert!((apart_m - 1.4).abs() < 0.26, "{apart_m} m at {time_s} s, {speed} times as fast");
            }
        }
    }
}
