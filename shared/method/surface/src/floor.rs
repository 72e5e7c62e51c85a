//! Up by the horizontal surfaces of one view: floor, tables, ceiling.

use crate::Vertex;
use nalgebra::Vector3;
use tessera_geometry::UpDirection;

/// Largest angle between the floor's normal and the image's own up: beyond it a wall may be as near.
const MOST_TILT_DEG: f64 = 40.0;
/// Normals of one plane differ by less; chosen, not fitted.
const SAME_PLANE_DEG: f64 = 8.0;
/// Least share of the vertices that a floor, a table and a ceiling have together; chosen, not fitted.
const LEAST_SHARE: f64 = 0.05;
/// Normals that are tried.
const N_TRIED: usize = 200;
/// Standard deviation of a floor's tilt, radians: by bent depth and by the floor itself; chosen, not fitted.
const FLOOR_SIGMA_RAD: f64 = 0.02;

/// Up by horizontal surfaces, which are the floor, tables and the ceiling; `None` where too few are seen.
pub fn floor_up(vertices: &[Vertex]) -> Option<UpDirection> {
    let least = libm::cos(MOST_TILT_DEG.to_radians());
    let valid = || vertices.iter().filter(|vertex| vertex.is_valid());
    let normals: Vec<Vector3<f64>> = valid()
        .map(|vertex| Vector3::from(vertex.normal.map(f64::from)))
        // A ceiling's points down.
        .map(|normal| if normal.y > 0.0 { -normal } else { normal })
        .filter(|normal| -normal.y >= least)
        .collect();
    let of_plane = libm::cos(SAME_PLANE_DEG.to_radians());
    let with = |up: &Vector3<f64>| {
        let near = normals.iter().filter(|normal| normal.dot(up) >= of_plane);
        near.fold((0_usize, Vector3::zeros()), |(n, sum), normal| (n + 1, sum + normal))
    };
    let tried = normals.iter().step_by(normals.len().div_ceil(N_TRIED).max(1));
    let (_, sum) = tried.map(with).max_by_key(|(n, _)| *n)?;
    let (n, sum) = with(&sum.normalize());
    let is_seen = n as f64 >= LEAST_SHARE * valid().count() as f64;
    is_seen.then(|| UpDirection::of(&sum, FLOOR_SIGMA_RAD)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    fn plane(normal: Vector3<f64>, n: usize) -> Vec<Vertex> {
        let normal = normal.normalize().map(|v| v as f32).into();
        vec![Vertex { normal, flags_rgb: Vertex::VALID, ..Vertex::default() }; n]
    }

    #[test]
    fn the_floor_is_told_from_walls_and_slopes() {
        let tilt = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -0.4);
        let camera_from_world = tilt.inverse();
        let of = |normal: Vector3<f64>, n| plane(camera_from_world * normal, n);
        let up = -Vector3::y();
        let wall = of(-Vector3::z(), 700);
        let slope = of(Vector3::new(0.5, -1.0, 0.0), 60);
        let mut seen = [wall, slope, of(up, 80), of(-up, 60)].concat();
        let found = floor_up(&seen).unwrap();
        assert!(Vector3::from(found.in_camera).angle(&(camera_from_world * up)) < 1e-6);
        // A wall alone, and nothing at all.
        seen.truncate(700);
        assert_eq!(floor_up(&seen), None);
        assert_eq!(floor_up(&[]), None);
    }
}
