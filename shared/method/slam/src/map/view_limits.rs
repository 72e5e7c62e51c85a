//! Views that may see the same: near each other in distance and angle together.

use nalgebra::Vector3;
use tessera_geometry::Pose;

/// How far two views may be apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ViewLimits {
    /// Distance of the camera centres, metres.
    pub(crate) radius_m: f64,
    /// Angle between the optical axes, radians.
    pub(crate) angle_rad: f64,
}

impl ViewLimits {
    /// The views within the limits of one with this centre and optical axis, nearest first, each
    /// with its score `distance / radius + angle / limit`. `others` yields names and centres in the
    /// world; `axis_of` is asked for those within the radius only: most keyframes of a long run are
    /// far away, and must cost nothing.
    pub(crate) fn nearest<Name: Copy + Ord>(
        &self,
        centre: &Vector3<f64>,
        axis: &Vector3<f64>,
        others: impl Iterator<Item = (Name, Vector3<f64>)>,
        axis_of: impl Fn(Name) -> Vector3<f64>,
    ) -> Vec<(f64, Name)> {
        let mut near = self.within(centre, axis, others, axis_of);
        near.sort_by(by_score);
        near
    }

    /// As [`Self::nearest`], in the order of `others`.
    pub(crate) fn within<Name: Copy>(
        &self,
        centre: &Vector3<f64>,
        axis: &Vector3<f64>,
        others: impl Iterator<Item = (Name, Vector3<f64>)>,
        axis_of: impl Fn(Name) -> Vector3<f64>,
    ) -> Vec<(f64, Name)> {
        // Most views look elsewhere, which takes no arc cosine to tell.
        let least_dot = libm::cos(self.angle_rad.min(std::f64::consts::PI)) - 1e-9;
        others
            .filter(|(_, other)| (other - centre).norm_squared() <= self.radius_m * self.radius_m)
            .filter(|(name, _)| axis_of(*name).dot(axis) >= least_dot)
            .filter_map(|(name, other)| {
                let angle_rad = angle_between(&axis_of(name), axis);
                let apart = (other - centre).norm() / self.radius_m.max(1e-9);
                let score = apart + angle_rad / self.angle_rad.max(1e-9);
                (angle_rad <= self.angle_rad).then_some((score, name))
            })
            .collect()
    }
}

/// Takes the `n` nearest views out of a list, nearest first.
pub(crate) fn take_nearest<Name: Copy + Ord>(views: &mut Vec<(f64, Name)>, n: usize) -> Vec<(f64, Name)> {
    if views.len() > n {
        // The order of thousands is not asked for.
        views.select_nth_unstable_by(n, by_score);
    }
    let rest = views.split_off(n.min(views.len()));
    let mut nearest = std::mem::replace(views, rest);
    nearest.sort_by(by_score);
    nearest
}

fn by_score<Name: Ord>(a: &(f64, Name), b: &(f64, Name)) -> std::cmp::Ordering {
    a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1))
}

/// The optical axis, a unit vector in the world.
pub(crate) fn optical_axis(world_from_camera: &Pose) -> Vector3<f64> {
    world_from_camera.rotation * Vector3::z()
}

/// Angle between two unit vectors, radians.
fn angle_between(a: &Vector3<f64>, b: &Vector3<f64>) -> f64 {
    libm::acos(a.dot(b).clamp(-1.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessera_geometry::{Twist, exp};

    #[test]
    fn views_come_nearest_first_within_both_limits() {
        let limits = ViewLimits { radius_m: 1.0, angle_rad: 0.5 };
        // x in metres and yaw in radians of each view.
        let views = [(0.9, 0.0), (0.2, 0.2), (0.2, 0.6), (1.1, 0.0), (-0.2, 0.2), (0.0, 0.1)];
        let axis = |yaw: f64| {
            let turn = Twist { rho: Vector3::zeros(), phi: Vector3::new(0.0, yaw, 0.0) };
            optical_axis(&exp(&turn))
        };
        let others = views.iter().enumerate().map(|(name, (x, _))| (name, Vector3::new(*x, 0.0, 0.0)));
        let found = limits.nearest(&Vector3::zeros(), &Vector3::z(), others, |name| axis(views[name].1));
        let names: Vec<usize> = found.iter().map(|(_, name)| *name).collect();
        assert_eq!(names, [5, 1, 4, 0]);
        assert!((found[1].0 - 0.6).abs() < 1e-9 && (found[0].0 - 0.2).abs() < 1e-9);
    }
}
